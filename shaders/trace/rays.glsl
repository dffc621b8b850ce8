// Rays that leave a surface and ask whether something stands in their way.
//
// A program that includes this binds the hierarchy and `film_view`, and has the constant `offset_size`.
#include "trace/hierarchy.glsl"

// How far beside a surface rays begin: what float32 positions of this size cannot tell apart.
float ray_offset(vec3 position)
{
  // Where an orthographic eye stands says nothing: what it sees is as wide as the picture.
  float away = (film_view.eye.w > 0.5) ? film_view.frame.y - film_view.frame.x : length(position - film_view.eye.xyz);
  return max(offset_size, 2e-5 * away);
}

vec3 ray_origin(vec3 position, vec3 normal)
{
  return position + normal * ray_offset(position);
}

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
