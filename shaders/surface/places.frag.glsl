// Where a surface lies, and the side of its triangle that is seen, as the surface images hold them.
#include "ask/view.glsl"
#include "lib/math.glsl"

void main()
{
  vec3 normal = safe_normalize(cross(dFdx(world_position), dFdy(world_position)));  // derivatives come before a discard
  float depth = view_depth(world_position);
  if (depth < film_view.film.z || depth > film_view.film.w) {
    discard;
  }
  normal = (dot(normal, view_toward(world_position)) < 0.0) ? -normal : normal;
  out_position = vec4(world_position, 1.0);
  out_normal = vec4(0.0, 0.0, octahedral_encode(normal));
}
