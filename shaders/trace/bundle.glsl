// Up to four rays from one place, which ask together whether something opaque stands in their way.
//
// Short rays to one light meet much the same boxes: a node is read once for all, and entered where one of them does, and
// so are the triangles of a leaf.
#include "trace/hierarchy.glsl"

// Those of the rays `open` that meet nothing opaque in a leaf: as intersect_four, with all that does not depend on the
// direction once.
uint open_behind(int leaf, vec3 origin, mat4 rays, uint open)
{
  Four f = four_read(leaf);
  vec4 tx = origin.x - f.x;
  vec4 ty = origin.y - f.y;
  vec4 tz = origin.z - f.z;
  vec4 nx = f.e2y * f.e1z - f.e2z * f.e1y;
  vec4 ny = f.e2z * f.e1x - f.e2x * f.e1z;
  vec4 nz = f.e2x * f.e1y - f.e2y * f.e1x;
  vec4 px = f.e2y * tz - f.e2z * ty;
  vec4 py = f.e2z * tx - f.e2x * tz;
  vec4 pz = f.e2x * ty - f.e2y * tx;
  vec4 qx = ty * f.e1z - tz * f.e1y;
  vec4 qy = tz * f.e1x - tx * f.e1z;
  vec4 qz = tx * f.e1y - ty * f.e1x;
  vec4 volume = f.e2x * qx + f.e2y * qy + f.e2z * qz;
  for (int k = 0; k < 4; k++) {
    vec3 direction = rays[k].xyz;
    vec4 facing = direction.x * nx + direction.y * ny + direction.z * nz;
    bvec4 edge_on = equal(facing, vec4(0.0));
    vec4 inverse = vec4(1.0) / mix(facing, vec4(1.0), edge_on);
    vec4 u = (direction.x * px + direction.y * py + direction.z * pz) * inverse;
    vec4 v = (direction.x * qx + direction.y * qy + direction.z * qz) * inverse;
    vec4 t = volume * inverse;
    bvec4 inside = lessThanEqual(max(max(-u, -v), max(u + v - vec4(1.0), -t)), vec4(0.0));
    t = mix(mix(vec4(1e30), t, inside), vec4(1e30), edge_on);
    if (min(min(t.x, t.y), min(t.z, t.w)) < rays[k].w && ((open >> uint(k)) & 1u) != 0u) {
      vec4 opacity = opacity_of_four(opacity_codes(leaf), leaf, t, rays[k].w, origin, direction, facing, false, false);
      t = mix(vec4(1e30), t, greaterThanEqual(opacity, vec4(1.0)));
      if (min(min(t.x, t.y), min(t.z, t.w)) < rays[k].w) {
        open &= ~(1u << uint(k));
      }
    }
  }
  return open;
}

// Those of the rays `open` (bits) that meet nothing opaque. A ray's column is its unit direction and, w, its length.
uint clear_bundle(vec3 origin, mat4 rays, uint open)
{
  mat4 inverses;
  for (int k = 0; k < 4; k++) {
    inverses[k] = vec4(1.0) / mix(rays[k], vec4(1e-20), equal(rays[k], vec4(0.0)));
  }
  Place place;
  place.index = 0;
  place.leaf = false;
#ifdef INSTANCED
  place.record = false;
  vec3 world_origin = origin;
  mat4 world_rays = rays;
  int inside = 0;  // record of the instance that the rays are in
  int bottom = 0;
#endif
  uint pending[DEEPEST];  // node, and as its last four bits the children still to visit
  int height = 0;
  uint top = 0u;
  for (int round = 0; round < 4096 && open != 0u; round++) {
    bool more = true;
    while (more && !place.leaf) {
      Boxes boxes = boxes_read(place.index * NODE_TEXELS);
      uint met = 0u;
      for (int k = 0; k < 4; k++) {
        vec4 enter;
        uint meets = boxes_met(boxes, origin, inverses[k].xyz, rays[k].w, enter);
        met |= (((open >> uint(k)) & 1u) != 0u) ? meets : 0u;
      }
      if (met != 0u) {
        if (!none_pending(top)) {
          pending[height] = top;
          height++;
        }
        top = (uint(place.index) << 4u) | met;
      }
      more = !none_pending(top);
      if (more) {
        int node;
        int child = next_pending(top, node);
        if (none_pending(top) && height > BOTTOM) {
          height--;
          top = pending[height];
        }
        place = node_child(node, child);
      }
    }
#ifdef INSTANCED
    // Into an instance, and out again, as in trace_layers.
    if (more && place.record) {
      if (!none_pending(top)) {
        pending[height] = top;
        height++;
      }
      top = 0u;
      bottom = height;
      inside = place.index;
      origin = record_placed(inside, world_origin);
      for (int k = 0; k < 4; k++) {
        rays[k].xyz = record_turned(inside, world_rays[k].xyz);
        inverses[k] = vec4(1.0) / mix(rays[k], vec4(1e-20), equal(rays[k], vec4(0.0)));
      }
      place.index = int(node_texel(inside * NODE_TEXELS + 3).x);
      place.leaf = false;
      continue;
    }
    if (more) {
      open = open_behind(place.index, origin, rays, open);
    }
#else
    if (!more) {
      break;
    }
    open = open_behind(place.index, origin, rays, open);
#endif
#ifdef INSTANCED
    if (none_pending(top) && inside != 0) {
      inside = 0;
      bottom = 0;
      origin = world_origin;
      rays = world_rays;
      for (int k = 0; k < 4; k++) {
        inverses[k] = vec4(1.0) / mix(rays[k], vec4(1e-20), equal(rays[k], vec4(0.0)));
      }
      if (height > 0) {
        height--;
        top = pending[height];
      }
    }
#endif
    if (none_pending(top)) {
      break;
    }
    int above;
    int child = next_pending(top, above);
    if (none_pending(top) && height > BOTTOM) {
      height--;
      top = pending[height];
    }
    place = node_child(above, child);
  }
  return open;
}
