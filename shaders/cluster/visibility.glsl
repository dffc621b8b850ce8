// Visibility of a cluster of virtual lights, an area light, from its map: convolution soft shadow mapping with distances.
//
// A point of the cluster at e from its middle and a receiver at the distance d see each other past a blocker that stands
// at the distance z, in the direction that is turned by  e' (1/z - 1/d),  e' being e seen from the receiver. So blockers
// at one distance lie in the cluster's own shape, the kernel. First the mean distance of blockers in the kernel of those
// that stand half-way, then the share of blockers in the kernel of that distance.
//
// A kernel of few texels looks at texels; no surface shadows itself there whatever its slant. Larger ones are cut into CELLS x CELLS boxes of the filtered map, compared with the nearest point of the receiver's plane there.
#include "cluster/lights.glsl"
#ifdef FILTER_MEANS
#include "cluster/depth.glsl"
#include "cssm/filter.glsl"
#endif

#define KERNEL_TEXELS 4  // up to this size of a kernel every texel is looked at
#define SAME 2e-3  // difference of distances, in distances, that is none

struct ClusterReceiver {
  vec4 rectangle;  // of the map in the atlas: corner, side
  float range;  // of the map, m
  float reach;  // distance from the middle, m
  vec3 towards;  // unit direction from the middle, in the cluster's frame
  vec3 normal;  // of the triangle, in the cluster's frame
  float height;  // of the middle above the receiver's plane, m
  vec2 texel;  // from the map's corner
};

// Distance from the middle to the receiver's plane in the direction of a place in the map; no more than to the receiver.
// A middle below the plane has members above it: for those only what is nearer than the receiver itself blocks.
float plane_distance(ClusterReceiver r, vec2 texel)
{
  if (r.height <= 0.0) {
    return 0.95 * r.reach;
  }
  float slope = -dot(r.normal, map_direction(texel / r.rectangle.z));
  return (slope * r.reach > r.height) ? r.height / slope : r.reach;
}

// Whether what is seen in a texel stands before the receiver: both its plane and the receiver's say so.
bool texel_blocks(ClusterReceiver r, vec4 seen, vec2 centre)
{
  float t = seen.x * r.range;
  if (seen.w == 0.0 || t >= plane_distance(r, centre) * (1.0 - SAME)) {
    return false;
  }
  vec3 normal = octahedral_decode(seen.yz);
  float ahead = dot(normal, r.towards);
  float there = t * dot(normal, map_direction(centre / r.rectangle.z)) / ((abs(ahead) > 1e-6) ? ahead : 1e-6);
  return there <= 0.0 || there < r.reach * (1.0 - SAME);
}

// Share of the box that is blocked (x), and the mean distance of what blocks (y), texel by texel.
vec2 box_of_texels(ClusterReceiver r, vec2 low, vec2 high)
{
  ivec2 first = ivec2(floor(low));
  ivec2 last = min(ivec2(ceil(high)), ivec2(r.rectangle.z)) - 1;
  float whole = 0.0;
  float blocked = 0.0;
  float distances = 0.0;
  for (int y = first.y; y <= last.y; y++) {
    for (int x = first.x; x <= last.x; x++) {
      vec2 covered = max(min(vec2(x, y) + 1.0, high) - max(vec2(x, y), low), vec2(0.0));
      float weight = covered.x * covered.y;
      vec4 seen = cluster_maps_fetch(ivec2(r.rectangle.xy) + ivec2(x, y));
      whole += weight;
      if (texel_blocks(r, seen, vec2(x, y) + 0.5)) {
        blocked += weight;
        distances += weight * seen.x * r.range;
      }
    }
  }
  return vec2(blocked / max(whole, 1e-12), distances / max(blocked, 1e-12));
}

#ifndef FILTER_MEANS
// The same from TAPS x TAPS texels of a large box.
vec2 box_of_taps(ClusterReceiver r, vec2 low, vec2 high)
{
  float blocked = 0.0;
  float distances = 0.0;
  for (int k = 0; k < TAPS * TAPS; k++) {
    vec2 part = (vec2(float(k % TAPS), float(k / TAPS)) + 0.5) / float(TAPS);
    vec2 texel = floor(mix(low, high, part));
    vec4 seen = cluster_maps_fetch(ivec2(r.rectangle.xy + texel));
    if (texel_blocks(r, seen, texel + 0.5)) {
      blocked += 1.0;
      distances += seen.x * r.range;
    }
  }
  return vec2(blocked / float(TAPS * TAPS), distances / max(blocked, 1.0));
}
#else
// The same from the filtered map, with SEARCH; without it the share alone.
vec2 box_of_means(ClusterReceiver r, vec2 low, vec2 high, bool search)
{
  vec2 size = (high - low) / float(CELLS);
  float blocked = 0.0;
  float distances = 0.0;
  for (int k = 0; k < CELLS * CELLS; k++) {
    vec2 a = low + size * vec2(float(k % CELLS), float(k / CELLS));
    vec2 b = a + size;
    float nearest = min(min(plane_distance(r, a), plane_distance(r, b)),
                        min(plane_distance(r, vec2(a.x, b.y)), plane_distance(r, vec2(b.x, a.y))));
    float d = cluster_depth(nearest / r.range);
    if (search) {
      vec2 found = basis_blockers(r.rectangle, a, b, d - SEARCH_OFFSET);
      if (found.x > LEAST_SHARE) {
        float share = min(found.x, 1.0);
        blocked += share;
        distances += share * cluster_share(min(found.y / found.x, d)) * r.range;
      }
    }
    else {
      blocked += basis_nearer(r.rectangle, a, b, d - SERIES_OFFSET);
    }
  }
  return vec2(blocked / float(CELLS * CELLS), distances / max(blocked, 1e-12));
}
#endif

// Half extents in texels, per 1/m, of the kernel as the receiver sees the cluster.
vec2 kernel_extent(Cluster c, ClusterReceiver r)
{
  vec3 across = vec3(c.half_side.x, 0.0, 0.0);
  vec3 along = vec3(0.0, c.half_side.y, 0.0);
  vec2 u = map_change(r.towards, across - r.towards * dot(across, r.towards));
  vec2 v = map_change(r.towards, along - r.towards * dot(along, r.towards));
  return r.rectangle.z * sqrt(u * u + v * v);  // the box with the same moments along the map's axes
}

vec2 kernel_box(ClusterReceiver r, vec2 half_size, bool search)
{
  half_size = clamp(half_size, vec2(0.5), vec2(0.5 * r.rectangle.z));
  vec2 low = clamp(r.texel - half_size, vec2(0.0), vec2(r.rectangle.z - 1.0));
  vec2 high = clamp(r.texel + half_size, low + 0.5, vec2(r.rectangle.z));
  if (max(half_size.x, half_size.y) <= 0.5 * float(KERNEL_TEXELS)) {
    return box_of_texels(r, low, high);
  }
#ifdef FILTER_MEANS
  return box_of_means(r, low, high, search);
#else
  return box_of_taps(r, low, high);
#endif
}

// Share of a cluster that a point of a surface sees. `normal`: of the triangle. `doubt`: how far single members may differ
// from it, as the standard deviation of what they see.
float cluster_visibility(Cluster c, vec3 position, vec3 normal, out float doubt)
{
  vec3 path = position - ray_origin(c.middle, c.plane_normal);
  ClusterReceiver r;
  r.rectangle = vec4(c.corner, float(map_side), 0.0);
  r.range = c.range;
  r.reach = length(path);
  r.normal = cluster_local(c, normal);
  r.height = -dot(normal, path);
  r.towards = cluster_local(c, path) / max(r.reach, 1e-30);
  vec2 place = map_place(r.towards);
  bool outside = any(lessThanEqual(place, vec2(0.0))) || any(greaterThanEqual(place, vec2(1.0)));
  // Behind its own surface or below the receiver's plane the middle knows little of the members that are not.
  doubt = (outside || r.height <= 0.0 || dot(path, c.plane_normal) <= 0.0) ? 0.5 : 0.0;
  if (outside) {
    return 1.0;
  }
  r.texel = place * r.rectangle.z;
  vec2 extent = kernel_extent(c, r);
  vec2 found = kernel_box(r, extent / r.reach, true);  // 1/z - 1/d half-way is 1/d
  if (found.x <= 0.0) {
    return 1.0;
  }
  float away = max(1.0 / max(found.y, 1e-3 * r.reach) - 1.0 / r.reach, 0.0);
  float visible = clamp(1.0 - kernel_box(r, extent * away, false).x, 0.0, 1.0);
  doubt = max(doubt, sqrt(visible * (1.0 - visible)));
  return visible;
}
