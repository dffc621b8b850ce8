// Visibility of up to four lights, one in each channel, at a pixel of the picture.
#include "lib/gbuffer.glsl"

ivec2 seen_pixel;
#define SEEN_PIXEL seen_pixel
#include "light/whole.glsl"
#include "generated/visibility"

vec4 visibility_at(ivec2 pixel)
{
  seen_pixel = pixel;
  vec4 visibility = vec4(1.0);
  vec3 position = surface_position_fetch(pixel).xyz;
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    if ((light.flags & LIGHT_SHADOW) != 0) {
      visibility[i] = light_visibility(light, position, normal);
    }
  }
  return visibility;
}
