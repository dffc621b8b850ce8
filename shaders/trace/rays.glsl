// Rays that leave a surface and ask whether something stands in their way.
//
// A program that includes this binds the hierarchy and `film_view`, and has the constant `offset_size`.
#include "trace/hierarchy.glsl"
#include "trace/origin.glsl"

float clear_path(vec3 origin, vec3 direction, float reach, uint salt)
{
  ivec2 hit;
  return (trace_until(origin, direction, reach, reach, salt, hit) >= reach) ? 1.0 : 0.0;
}

// The same for a ray that looks for a light; `glass_stops` it, or lets it pass at random.
float clear_to_light(vec3 origin, vec3 direction, float reach, uint salt, bool glass_stops)
{
  ivec2 hit;
  return (trace_layers(origin, direction, reach, reach, salt, glass_stops, true, hit) >= reach) ? 1.0 : 0.0;
}
