// Nearest hit of a ray in the bounding volume hierarchy of addon/frame/acceleration.py.
//
// The tree is complete and four-wide, so a node's address follows from its level and number, and the children that are
// still to visit are four bits per level in one pair of integers: no stack in memory.
#include "lib/math.glsl"
#include "lib/random.glsl"

#define NODE_TEXELS 6
#define LEAF_TEXELS 13

vec4 node_texel(int index)
{
  return texelFetch(trace_nodes, ivec2(index & 2047, index >> 11), 0);
}

vec4 leaf_texel(int index)
{
  return texelFetch(trace_leaves, ivec2(index & 2047, index >> 11), 0);
}

// Distances to four triangles at once (Moeller & Trumbore 1997); 1e30 where missed.
vec4 intersect_four(int leaf, vec3 origin, vec3 direction)
{
  int base = leaf * LEAF_TEXELS;
  vec4 e1x = leaf_texel(base + 3);
  vec4 e1y = leaf_texel(base + 4);
  vec4 e1z = leaf_texel(base + 5);
  vec4 e2x = leaf_texel(base + 6);
  vec4 e2y = leaf_texel(base + 7);
  vec4 e2z = leaf_texel(base + 8);
  vec4 px = direction.y * e2z - direction.z * e2y;
  vec4 py = direction.z * e2x - direction.x * e2z;
  vec4 pz = direction.x * e2y - direction.y * e2x;
  vec4 determinant = e1x * px + e1y * py + e1z * pz;
  vec4 inverse = vec4(1.0) / mix(determinant, vec4(1.0), equal(determinant, vec4(0.0)));
  vec4 tx = origin.x - leaf_texel(base);
  vec4 ty = origin.y - leaf_texel(base + 1);
  vec4 tz = origin.z - leaf_texel(base + 2);
  vec4 u = (tx * px + ty * py + tz * pz) * inverse;
  vec4 qx = ty * e1z - tz * e1y;
  vec4 qy = tz * e1x - tx * e1z;
  vec4 qz = tx * e1y - ty * e1x;
  vec4 v = (direction.x * qx + direction.y * qy + direction.z * qz) * inverse;
  vec4 t = (e2x * qx + e2y * qy + e2z * qz) * inverse;
  bvec4 inside = lessThanEqual(max(max(-u, -v), max(u + v - vec4(1.0), -t)), vec4(0.0));
  t = mix(vec4(1e30), t, inside);
  return mix(t, vec4(1e30), equal(determinant, vec4(0.0)));
}

// Distance along the unit `direction` to the nearest triangle before `limit`, or `limit`; `hit` is its leaf and its
// number there. Triangles with an opacity below one are passed at random, the same way for the same `salt`.
float trace_nearest(vec3 origin, vec3 direction, float limit, uint salt, out ivec2 hit)
{
  hit = ivec2(-1);
  vec3 inverse = vec3(1.0) / mix(direction, vec3(1e-20), equal(direction, vec3(0.0)));
  float nearest = limit;
  int level = 0;
  int node = 0;
  int level_start = 0;  // number of nodes on all levels above
  uvec2 pending = uvec2(0u);
  bool arrived = true;
  for (int step = 0; step < 4096; step++) {
    if (arrived) {
      int base = (level_start + node) * NODE_TEXELS;
      vec4 x0 = (node_texel(base) - origin.x) * inverse.x;
      vec4 y0 = (node_texel(base + 1) - origin.y) * inverse.y;
      vec4 z0 = (node_texel(base + 2) - origin.z) * inverse.z;
      vec4 x1 = (node_texel(base + 3) - origin.x) * inverse.x;
      vec4 y1 = (node_texel(base + 4) - origin.y) * inverse.y;
      vec4 z1 = (node_texel(base + 5) - origin.z) * inverse.z;
      vec4 enter = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), vec4(0.0)));
      vec4 leave = min(min(max(x0, x1), max(y0, y1)), min(max(z0, z1), vec4(nearest)));
      bvec4 met = lessThanEqual(enter, leave * 1.0000004);
      uint mask = (met.x ? 1u : 0u) | (met.y ? 2u : 0u) | (met.z ? 4u : 0u) | (met.w ? 8u : 0u);
      if (level < 8) {
        pending.x |= mask << uint(4 * level);
      }
      else {
        pending.y |= mask << uint(4 * (level - 8));
      }
      arrived = false;
    }
    uint here = ((level < 8) ? pending.x >> uint(4 * level) : pending.y >> uint(4 * (level - 8))) & 15u;
    if (here == 0u) {
      if (level == 0) {
        break;
      }
      level--;
      node >>= 2;
      level_start = (level_start - 1) >> 2;
      continue;
    }
    int child = ((here & 1u) != 0u) ? 0 : ((here & 2u) != 0u) ? 1 : ((here & 4u) != 0u) ? 2 : 3;
    uint bit = 1u << uint(child + 4 * (level & 7));
    if (level < 8) {
      pending.x &= ~bit;
    }
    else {
      pending.y &= ~bit;
    }
    int next = node * 4 + child;
    if (level + 1 == trace_levels) {
      vec4 t = intersect_four(next, origin, direction);
      float best = min(min(t.x, t.y), min(t.z, t.w));
      if (best < nearest) {
        vec4 opacity = leaf_texel(next * LEAF_TEXELS + 9);
        uint roll = hash3(uvec3(uint(next), salt, 77u)).x;
        vec4 chance = vec4(to_unit(roll), to_unit(roll * 747796405u + 1u), to_unit(roll * 2891336453u + 3u),
                           to_unit(roll * 277803737u + 7u));
        t = mix(vec4(1e30), t, lessThan(chance, opacity));
        best = min(min(t.x, t.y), min(t.z, t.w));
        if (best < nearest) {
          nearest = best;
          hit = ivec2(next, (best == t.x) ? 0 : (best == t.y) ? 1 : (best == t.z) ? 2 : 3);
        }
      }
    }
    else {
      node = next;
      level_start = level_start * 4 + 1;
      level++;
      arrived = true;
    }
  }
  return nearest;
}

// Radiance that a triangle emits (mean over its material), and its unit normal.
vec3 triangle_emission(ivec2 hit, out vec3 normal)
{
  int base = hit.x * LEAF_TEXELS;
  int k = hit.y;
  vec3 e1 = vec3(leaf_texel(base + 3)[k], leaf_texel(base + 4)[k], leaf_texel(base + 5)[k]);
  vec3 e2 = vec3(leaf_texel(base + 6)[k], leaf_texel(base + 7)[k], leaf_texel(base + 8)[k]);
  normal = safe_normalize(cross(e1, e2));
  return vec3(leaf_texel(base + 10)[k], leaf_texel(base + 11)[k], leaf_texel(base + 12)[k]);
}
