// What media let pass, in a scene that has none: all. Where a scene has media, media/media.glsl is included in place of
// this file (addon/gfx/interface.py).
#define FARTHEST_MEDIUM 1e29

vec3 media_transmittance(vec3 origin, vec3 direction, float limit, uint salt)
{
  return vec3(1.0);
}
