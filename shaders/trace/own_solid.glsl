// Rays that an edit sends into the solid that they start on. A program that includes this binds `film_view` and the hierarchy
// and has the constant `offset_size`.
#include "trace/hierarchy.glsl"

#define MOST_OWN_WALLS 4  // that a ray leaves by; a solid with more folds on its way shows itself

// Where a ray has left all solids that it begins in, as told by the sides of the triangles that it meets first.
vec3 beyond_solid(vec3 origin, vec3 direction, uint salt)
{
  ivec2 hit;
  for (int wall = 0; wall < MOST_OWN_WALLS; wall++) {
    float t = trace_layers(origin, direction, 1e29, 0.0, salt, true, false, hit);  // walls of glass, too
    if (t >= 1e29) {
      return origin;
    }
    vec3 corner;
    vec3 e1;
    vec3 e2;
    triangle_edges(hit, corner, e1, e2);
    vec3 normal = cross(e1, e2);
    normal = (dot(normal, triangle_shading_normal(hit, corner)) < 0.0) ? -normal : normal;
    if (dot(normal, direction) <= 0.0) {
      return origin;
    }
    vec3 met = origin + t * direction;
    origin = met + max(offset_size, 2e-5 * distance(met, film_view.eye.xyz)) * direction;
  }
  return origin;
}
