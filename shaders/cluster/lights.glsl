// Clusters of virtual lights as area lights, each with one map of what it sees. They stand below the virtual lights, whose
// order is theirs (`virtual_lights`, a column each):
//   row 3: middle, a point on a surface; w: depth range of the map, m
//   row 4: unit vector along the longer side; w: half of that side, m
//   row 5: unit vector along the shorter side; w: half of that side, m
//   row 6: normal of the surface at the middle; w: first member
//   row 7: corner of its map in the atlas, texels; number of members
//
// The map is the stereographic projection of all directions around the cluster's normal, a half space and some more:
//
//     place = 1/2 + (x, y) / (1 + z) * MAP_SCALE / 2
//
// It is conformal, so that a small kernel keeps its shape wherever it lies.
#include "lib/math.glsl"

#define MAP_SCALE 0.8  // the middle of an edge stands for tan(angle / 2) = 1.25, 102 degrees from the normal

struct Cluster {
  vec3 middle;
  float range;
  vec3 across;
  vec3 along;
  vec2 half_side;
  vec3 plane_normal;
  vec3 normal;
  vec2 corner;
  int first;
  int count;
};

Cluster cluster_read(int index)
{
  vec4 a = virtual_lights_fetch(ivec2(index, 3));
  vec4 b = virtual_lights_fetch(ivec2(index, 4));
  vec4 c = virtual_lights_fetch(ivec2(index, 5));
  vec4 d = virtual_lights_fetch(ivec2(index, 6));
  vec4 e = virtual_lights_fetch(ivec2(index, 7));
  Cluster cluster;
  cluster.middle = a.xyz;
  cluster.range = a.w;
  cluster.across = b.xyz;
  cluster.along = c.xyz;
  cluster.half_side = vec2(b.w, c.w);
  cluster.plane_normal = d.xyz;
  cluster.normal = cross(b.xyz, c.xyz);
  cluster.corner = e.xy;
  cluster.first = int(d.w);
  cluster.count = int(e.z);
  return cluster;
}

// Unit direction in the cluster's frame (z along its normal) from a place in the map, 0..1.
vec3 map_direction(vec2 place)
{
  vec2 p = (2.0 * place - 1.0) / MAP_SCALE;
  float squared = dot(p, p);
  return vec3(2.0 * p, 1.0 - squared) / (1.0 + squared);
}

vec2 map_place(vec3 direction)
{
  return 0.5 + 0.5 * MAP_SCALE * direction.xy / max(1.0 + direction.z, 1e-6);
}

// Change of the place for a change of the direction that is perpendicular to it.
vec2 map_change(vec3 direction, vec3 change)
{
  float z = max(1.0 + direction.z, 1e-6);
  return 0.5 * MAP_SCALE * (change.xy - direction.xy * (change.z / z)) / z;
}

vec3 cluster_local(Cluster c, vec3 v)
{
  return vec3(dot(v, c.across), dot(v, c.along), dot(v, c.normal));
}
