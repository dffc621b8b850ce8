// Visibility of this sample's point of a light by a ray of each pixel, where that costs less than a depth map.
#include "light/sources.glsl"
#include "trace/rays.glsl"

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  // Aimed from where the ray begins: one beside it would end behind the emissive triangle that the point lies on.
  vec3 origin = ray_origin(position, normal);
  vec3 direction;
  float density;
  light_sample(light, origin, direction, density);
  float reach = 0.9999 * light_distance(light, origin, direction);
  uvec3 salt = roll_of(pixel, film_view.sample_index, film_view.seed, 17);
  return clear_to_light(origin, direction, reach, salt.x, (light.flags & LIGHT_GLASS_BLOCKS) != 0);
}
