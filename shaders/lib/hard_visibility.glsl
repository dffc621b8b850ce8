// Visibility of the light's point of this sample.
#include "lib/shadow.glsl"
#include "light/sources.glsl"

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  return shadow_visibility(light.first_view, light.view_count, position, normal, LAYERS_SHADE(pixel));
}
