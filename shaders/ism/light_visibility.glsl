// Visibility of points of wide lights, and of directions, by small maps: `map_eyes` holds the point and the axis of each.
#include "light/sources.glsl"
#include "ism/visibility.glsl"

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  vec3 eye = map_eyes_fetch(ivec2(light.first_view, 0)).xyz;
  vec3 axis = map_eyes_fetch(ivec2(light.first_view, 1)).xyz;
  return map_visibility(light.first_view, eye, axis, position, normal, half_extent);
}
