// Visibility of this sample's point of a light by a ray, for lights that no depth map can stand for.
#include "light/sources.glsl"
#include "trace/hierarchy.glsl"

float light_visibility(Light light, vec3 position, vec3 normal)
{
  vec3 direction;
  float density;
  light_sample(light, position, direction, density);
  vec3 origin = position + normal * max(offset_size, 2e-5 * length(position - film_view.eye.xyz));
  float reach = 0.9999 * light_distance(light, origin, direction);
  uvec3 salt = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(film_view.sample_index)));
  ivec2 hit;
  return (trace_until(origin, direction, reach, reach, salt.x, hit) >= reach) ? 1.0 : 0.0;
}
