// Visibility of up to four lights that was found before, of the lights one above the other (lighting/shared_visibility.py).
#include "light/sources.glsl"

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  int index = light.base / LIGHT_TEXELS;
  return pixel_visibility_fetch(pixel + ivec2(0, index * surface_position_size().y)).x;
}
