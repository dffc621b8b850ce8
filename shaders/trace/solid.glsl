// What the inside of solids absorbs along a part of a ray. What includes this has trace/hierarchy.glsl, and says beforehand
// `vec3 solid_absorbs(int material)`: what the inside of a material's solids absorbs, 1/m; below 0: it is clear glass.

#define MOST_PASSED 8  // surfaces behind the ray's end that are looked at

// Per metre. The ray begins beside an interface and meets `hit` after `t`, from inside that solid where it `leaves` it.
// What absorbs at one of both ends says whether the ray is in it: first the one that it leaves, then the one that it begins
// at, by looking back. Where there is but clear glass, as between the walls of a tumbler into which its drink reaches, the
// ray is in the solid whose face it would leave first of all that absorb.
// `offset`: how far beside surfaces rays begin.
vec3 solid_absorption(vec3 origin, vec3 direction, float t, ivec2 hit, bool leaves, float offset, uint salt)
{
  vec3 end = solid_absorbs(triangle_material(hit));
  bool known = max_component(end) > 0.0;
  if (known && leaves) {
    return end;
  }
  bool clear = end.x < 0.0;
  vec3 from = origin;
  // One call for all: compilers hold the code of each.
  for (int k = 0; k <= MOST_PASSED; k++) {
    vec3 way = (k == 0) ? -direction : direction;
    ivec2 other;
    float s = trace_layers(from, way, (k == 0) ? 64.0 * offset : 1e29, 0.0, salt, true, false, other);
    if (other.x >= 0) {
      vec3 place = from + s * way;
      vec3 normal = triangle_normal(other);
      normal = (dot(normal, triangle_shading_normal(other, place)) < 0.0) ? -normal : normal;
      vec3 inside = solid_absorbs(triangle_material(other));
      if (max_component(inside) > 0.0) {
        return (dot(normal, way) > 0.0) ? inside : vec3(0.0);
      }
      clear = clear || inside.x < 0.0;
      from = place + offset * way;
    }
    if (known || !clear || (k > 0 && other.x < 0)) {
      break;
    }
    from = (k == 0) ? origin + (t + offset) * direction : from;
  }
  return vec3(0.0);
}
