// In which solid a ray is that has just left an interface. What includes this has trace/hierarchy.glsl.

// The material of that solid, found by looking back at the interface; -1: none. Asked where a ray ends on something that
// stands in it (where it leaves the solid, the surface that it leaves by says as much).
// `offset`: how far beside surfaces rays begin.
int solid_around(vec3 origin, vec3 direction, float offset, uint salt)
{
  ivec2 hit;
  float t = trace_layers(origin, -direction, 64.0 * offset, 0.0, salt, true, false, hit);
  if (hit.x < 0) {
    return -1;
  }
  vec3 normal = triangle_normal(hit);
  normal = (dot(normal, triangle_shading_normal(hit, origin - t * direction)) < 0.0) ? -normal : normal;
  return (dot(normal, direction) < 0.0) ? triangle_material(hit) : -1;
}
