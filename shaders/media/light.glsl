// What media let pass between a place and a light.
#include "ask/media.glsl"
#include "light/sources.glsl"

vec3 light_through_media(Light light, ivec2 pixel, vec3 position, vec3 direction)
{
  float reach = min(light_distance(light, position, direction), FARTHEST_MEDIUM);
  return media_transmittance(position, direction, reach, roll_of(pixel, film_view.sample_index, film_view.seed, 42).x);
}
