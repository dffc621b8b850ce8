// The ray of a pixel that mirrors and glass send on, up to what it has met, and the images that take what media send back along it.
#define DIRECT_PATHS
#include "hits/shown.glsl"

struct ViewRay {
  vec3 origin;
  vec3 direction;
  float limit;
};

// False if the pixel has none.
bool lobe_ray(ivec2 pixel, out ViewRay ray, out int asks)
{
  int code = int(met_path_fetch(pixel).w + 0.5);
  ray.origin = lobe_start_fetch(pixel).xyz;
  ray.direction = lobe_way_fetch(pixel).xyz;
  vec4 met = surface_position_fetch(pixel);
  ray.limit = (met.w != 0.0) ? max(dot(met.xyz - ray.origin, ray.direction), 0.0) : FARTHEST_MEDIUM;
  asks = path_is_bent(code) ? MEDIA_OF_TRANSMISSION : MEDIA_OF_GLOSSY;
  return code != 0;
}

// Of layers before a place on it: those that it has passed count for what it has met alone.
vec3 layers_before(ivec2 pixel, float t)
{
  return vec3(1.0);
}

// What media send back along a ray counts as light that the first surface mirrors or lets pass: what they emit, direct on
// the first ray; all else indirect, as in Cycles.
void show(ivec2 pixel, vec3 scattered, vec3 emitted)
{
  vec4 path = met_path_fetch(pixel);
  vec3 direct = (ray_number == 0) ? path.rgb * emitted : vec3(0.0);
  vec3 indirect = path.rgb * scattered + ((ray_number == 0) ? vec3(0.0) : path.rgb * emitted);
  show_light(int(path.w + 0.5), vec4(direct, 0.0), vec4(indirect, 0.0));
}
