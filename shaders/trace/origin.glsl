// Where rays begin that leave a surface. A program that includes this binds `film_view` and has the constant `offset_size`.
#include "ask/view.glsl"

// How far beside a surface rays begin: what float32 positions of this size cannot tell apart.
float ray_offset(vec3 position)
{
  return max(offset_size, 2e-5 * view_reach(position));
}

vec3 ray_origin(vec3 position, vec3 normal)
{
  return position + normal * ray_offset(position);
}
