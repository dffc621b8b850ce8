// Visibility of a light at a pixel of the picture.
#include "lib/gbuffer.glsl"
#include "light/whole.glsl"
#include "generated/visibility"

float visibility_at(ivec2 pixel, int index)
{
  Light light = light_read(index);
  if ((light.flags & LIGHT_SHADOW) == 0) {
    return 1.0;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  return light_visibility(light, pixel, surface_position_fetch(pixel).xyz, normal);
}
