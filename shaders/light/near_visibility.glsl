// Visibility of this sample's point of a round light: by its depth map where the light is small beside its distance,
// and by a ray where no depth map can stand for it. `near_share`: the quotient of both from which rays are taken.
#include "lib/shadow.glsl"
#include "light/sources.glsl"
#include "trace/rays.glsl"

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  if (light.radius <= near_share * length(light.centre - position)) {
    layers_begin();  // the map is of one channel, and no ray has passed any
    return shadow_visibility(light.first_view, light.view_count, position, normal, LAYERS_SHADE(pixel));
  }
  vec3 direction;
  float density;
  light_sample(light, position, direction, density);
  vec3 origin = ray_origin(position, normal);
  float reach = 0.9999 * light_distance(light, origin, direction);
  uvec3 salt = roll_of(pixel, film_view.sample_index, film_view.seed, 17);
  return clear_to_light(origin, direction, reach, salt.x, (light.flags & LIGHT_GLASS_BLOCKS) != 0);
}
