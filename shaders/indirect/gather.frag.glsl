// Light of this sample's virtual lights that diffuse surfaces reflect, bounded where they are near: near.frag.glsl has what
// the bound leaves out. Two programs, since a driver compiles each while a viewport waits.
#include "indirect/path.glsl"
#include "indirect/drawn_pixel.glsl"
#include "indirect/traced_gather.glsl"

void main()
{
  out_diffuse = vec4(0.0);
  ivec2 pixel;
  if (!drawn_pixel(pixel)) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  if (!(max_component(s.diffuse) > 0.0)) {
    return;
  }
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 31u));
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 7);
  float choice = scrambled(film_view.bits_w, salt.z);
  vec3 origin = ray_origin(s.position, s.geometric_normal);
  out_diffuse.rgb = virtual_gather(s, TO_VIEWER(s), true, origin, choice, salt.x + roll.x);
}
