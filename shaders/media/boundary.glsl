// Where a ray crosses the boundaries of media: all crossings along the whole ray, sorted, and in which media it starts.
//
// The tree is that of addon/scene/acceleration.py over the meshes that bound media alone; a triangle's material number
// is that of its medium. Nothing is known of a ray's start: a medium is around it if the first crossing of its boundary
// leads out. So rays may start anywhere, on boundaries too, without any state from other rays. MEDIA_BOXES: boundaries are so
// many boxes, each met by its planes in place of the tree, as `media_table` has them.
#include "lib/math.glsl"

#ifdef MEDIA_BOXES
#define MOST_CROSSINGS (2 * MEDIA_BOXES)
#elif defined(MEDIA_BOUNDED)
#define MOST_CROSSINGS 12
#else
#define MOST_CROSSINGS 1
#endif

struct Crossings {
  int count;
  float t[MOST_CROSSINGS];
  int medium[MOST_CROSSINGS];  // m + 1 where the ray enters medium m, -(m + 1) where it leaves it
  // Of crossings that there is no room for, the farthest ones: media that they cross an odd number of times, as bits, and
  // where the last of them is. Up to there the ray stays in what the others lead to.
  uint dropped;
  float beyond;
  int last_dropped;  // a ray through the edge of two triangles crosses once
  float last_dropped_at;
};

// Of the ray that was asked for last. Not a parameter: compilers copy arrays for each call, and take long over it.
Crossings crossings;

// Which rays are asked about. MEDIA_APART: some media are seen by a part of them alone (the object's ray visibility).
// `media_table` lists those that each kind of ray sees, 15 bits in each of two numbers, before its first row's last texel.
#define MEDIA_OF_CAMERA 0
#define MEDIA_OF_SHADOW 1
#define MEDIA_OF_DIFFUSE 2
#define MEDIA_OF_GLOSSY 3
#define MEDIA_OF_TRANSMISSION 4
#define MEDIA_OF_VOLUME 5
#ifdef MEDIA_APART
int media_ray;  // whoever follows a ray says it before
uint media_seen;
#define media_asked_by(kind) media_ray = (kind)
#else
#define media_asked_by(kind)
#endif

// Two crossings that are one: into or out of the same medium at the same place.
#define SAME_PLACE 1e-5

#ifdef MEDIA_APART
void media_see()
{
  vec4 listed = media_table_fetch(ivec2(2046 - media_ray, 0));
  media_seen = uint(listed.x) | (uint(listed.y) << 15u);
}
#endif

#define MEDIUM_TEXELS 13

#if defined(MEDIA_BOXES)
#define FIRST_BOX 1  // bit 0 is the world's

// Where a ray enters a medium's box and where it leaves it; not in this order where it passes by.
vec2 media_box(int medium, vec3 origin, vec3 direction)
{
  vec4 x = media_table_fetch(ivec2(medium * MEDIUM_TEXELS + 10, 0));
  vec4 y = media_table_fetch(ivec2(medium * MEDIUM_TEXELS + 11, 0));
  vec4 z = media_table_fetch(ivec2(medium * MEDIUM_TEXELS + 12, 0));
  vec3 place = vec3(dot(x.xyz, origin) + x.w, dot(y.xyz, origin) + y.w, dot(z.xyz, origin) + z.w);
  vec3 way = vec3(dot(x.xyz, direction), dot(y.xyz, direction), dot(z.xyz, direction));
  vec3 inverse = vec3(1.0) / mix(way, vec3(1e-20), equal(way, vec3(0.0)));
  vec3 low = -place * inverse;
  vec3 high = (vec3(1.0) - place) * inverse;
  vec3 enter = min(low, high);
  return vec2(max_component(enter), -max_component(-max(low, high)));
}

void crossings_insert(float t, int medium)
{
  int place = crossings.count;
  for (; place > 0 && crossings.t[place - 1] > t; place--) {
    crossings.t[place] = crossings.t[place - 1];
    crossings.medium[place] = crossings.medium[place - 1];
  }
  crossings.t[place] = t;
  crossings.medium[place] = medium;
  crossings.count++;
}
#elif defined(MEDIA_BOUNDED)
#define MEDIA_NODE 4   // texels of a node and of a leaf, as in addon/scene/acceleration.py
#define MEDIA_LEAF 17
#define MEDIA_DEEPEST 32

// The first row of the image is the table of media, whose last texel says where the leaves begin.
vec4 media_node_texel(int index)
{
  return media_table_fetch(ivec2(index & 2047, 1 + (index >> 11)));
}

vec4 media_leaf_texel(int index)
{
  return media_table_fetch(ivec2(index & 2047, index >> 11));
}

uint media_boxes_met(int base, vec3 origin, vec3 inverse)
{
  vec4 frame = media_node_texel(base);
  uint exponents = uint(frame.w);
  vec3 step_size = vec3(uintBitsToFloat((exponents & 255u) << 23u), uintBitsToFloat((exponents & 65280u) << 15u),
                        uintBitsToFloat((exponents & 16711680u) << 7u));
  uvec4 low = uvec4(media_node_texel(base + 1));
  uvec4 high = uvec4(media_node_texel(base + 2));
  vec3 slope = step_size * inverse;
  vec3 start = (frame.xyz - origin) * inverse;
  vec4 x0 = vec4(low & 255u) * slope.x + start.x;
  vec4 y0 = vec4((low >> 8u) & 255u) * slope.y + start.y;
  vec4 z0 = vec4(low >> 16u) * slope.z + start.z;
  vec4 x1 = vec4(high & 255u) * slope.x + start.x;
  vec4 y1 = vec4((high >> 8u) & 255u) * slope.y + start.y;
  vec4 z1 = vec4(high >> 16u) * slope.z + start.z;
  vec4 enter = max(max(inverse.x > 0.0 ? x0 : x1, inverse.y > 0.0 ? y0 : y1),
                   max(inverse.z > 0.0 ? z0 : z1, vec4(0.0)));
  vec4 leave = min(min(inverse.x > 0.0 ? x1 : x0, inverse.y > 0.0 ? y1 : y0), inverse.z > 0.0 ? z1 : z0);
  bvec4 met = lessThanEqual(enter, leave * 1.000001);
  return (met.x ? 1u : 0u) | (met.y ? 2u : 0u) | (met.z ? 4u : 0u) | (met.w ? 8u : 0u);
}

void crossings_insert(float t, int medium)
{
  int place = min(crossings.count, MOST_CROSSINGS - 1);
  for (int i = 0; i < crossings.count; i++) {
    if (crossings.medium[i] == medium && abs(crossings.t[i] - t) <= SAME_PLACE * t) {
      return;
    }
  }
  if (crossings.count == MOST_CROSSINGS) {
    float last = crossings.t[MOST_CROSSINGS - 1];
    int gone = (t >= last) ? medium : crossings.medium[MOST_CROSSINGS - 1];
    float place_of_it = max(t, last);
    bool known = gone == crossings.last_dropped && abs(crossings.last_dropped_at - place_of_it) <= SAME_PLACE * place_of_it;
    crossings.dropped ^= known ? 0u : 1u << uint(abs(gone) - 1);
    crossings.last_dropped = gone;
    crossings.last_dropped_at = place_of_it;
    crossings.beyond = max(crossings.beyond, place_of_it);
    if (t >= last) {
      return;
    }
  }
  crossings.count = min(crossings.count + 1, MOST_CROSSINGS);
  for (int i = place; i > 0; i--) {
    if (crossings.t[i - 1] <= t) {
      break;
    }
    crossings.t[i] = crossings.t[i - 1];
    crossings.medium[i] = crossings.medium[i - 1];
    place = i - 1;
  }
  crossings.t[place] = t;
  crossings.medium[place] = medium;
}

// Four triangles at once, then those that are met one after the other: compilers make four copies of a loop over four.
void media_leaf(int leaf, vec3 origin, vec3 direction)
{
  int base = int(media_table_fetch(ivec2(2047, 0)).x) + leaf * MEDIA_LEAF;
  vec4 e1x = media_leaf_texel(base + 3);
  vec4 e1y = media_leaf_texel(base + 4);
  vec4 e1z = media_leaf_texel(base + 5);
  vec4 e2x = media_leaf_texel(base + 6);
  vec4 e2y = media_leaf_texel(base + 7);
  vec4 e2z = media_leaf_texel(base + 8);
  vec4 px = direction.y * e2z - direction.z * e2y;
  vec4 py = direction.z * e2x - direction.x * e2z;
  vec4 pz = direction.x * e2y - direction.y * e2x;
  vec4 determinant = e1x * px + e1y * py + e1z * pz;
  vec4 sx = origin.x - media_leaf_texel(base);
  vec4 sy = origin.y - media_leaf_texel(base + 1);
  vec4 sz = origin.z - media_leaf_texel(base + 2);
  vec4 u = (sx * px + sy * py + sz * pz) / determinant;
  vec4 qx = sy * e1z - sz * e1y;
  vec4 qy = sz * e1x - sx * e1z;
  vec4 qz = sx * e1y - sy * e1x;
  vec4 v = (direction.x * qx + direction.y * qy + direction.z * qz) / determinant;
  vec4 t = (e2x * qx + e2y * qy + e2z * qz) / determinant;
  bvec4 inside = lessThanEqual(max(max(-u, -v), u + v - vec4(1.0)), vec4(1e-6));
  bvec4 before = greaterThan(t, vec4(0.0));
  bvec4 edge_on = equal(determinant, vec4(0.0));
  vec4 medium = media_leaf_texel(base + 13);
  uint met = 0u;
  for (int k = 0; k < 4; k++) {
    met |= (inside[k] && before[k] && !edge_on[k]) ? (1u << uint(k)) : 0u;
  }
  while (met != 0u) {
    int k = findLSB(met);
    met &= met - 1u;
    int number = int(medium[k] + 0.5) + 1;
    crossings_insert(t[k], (determinant[k] > 0.0) ? number : -number);  // seen from outside corners run anticlockwise
  }
}
#endif

void media_crossings(vec3 origin, vec3 direction)
{
  crossings.count = 0;
  crossings.dropped = 0u;
  crossings.beyond = 0.0;
  crossings.last_dropped = 0;
  crossings.last_dropped_at = 0.0;
  for (int i = 0; i < MOST_CROSSINGS; i++) {
    crossings.t[i] = 1e30;
    crossings.medium[i] = 0;
  }
#if defined(MEDIA_BOXES)
  for (int k = FIRST_BOX; k < FIRST_BOX + MEDIA_BOXES; k++) {
    vec2 met = media_box(k, origin, direction);
    if (met.y > max(met.x, 0.0)) {
      if (met.x > 0.0) {
        crossings_insert(met.x, k + 1);
      }
      crossings_insert(met.y, -(k + 1));
    }
  }
#elif defined(MEDIA_BOUNDED)
  vec3 inverse = vec3(1.0) / mix(direction, vec3(1e-20), equal(direction, vec3(0.0)));
  int pending[MEDIA_DEEPEST];
  uint bits[MEDIA_DEEPEST];
  int height = 0;
  pending[0] = 0;
  bits[0] = media_boxes_met(0, origin, inverse);
  for (int round = 0; round < 4096 && height >= 0; round++) {
    uint met = bits[height];
    if (met == 0u) {
      height--;
      continue;
    }
    int child = findLSB(met);
    bits[height] = met & (met - 1u);
    vec4 links = media_node_texel(pending[height] * MEDIA_NODE + 3);
    int nodes = int(links.z);
    if (child >= nodes) {
      media_leaf(int(links.y) + child - nodes, origin, direction);
    }
    else {
      int node = int(links.x) + child;
      uint below = media_boxes_met(node * MEDIA_NODE, origin, inverse);
      if (below != 0u && height < MEDIA_DEEPEST - 1) {
        height++;
        pending[height] = node;
        bits[height] = below;
      }
    }
  }
#endif
}

// Media around the ray's start, as bits; the world's medium is bit 0. The first crossing of a boundary decides; where it was
// dropped, that of a closed one by their number.
uint media_at_start()
{
#ifdef MEDIA_WORLD
  uint inside = 1u;
#else
  uint inside = 0u;
#endif
  uint seen = 1u;
  for (int i = 0; i < crossings.count; i++) {
    uint bit = 1u << uint(abs(crossings.medium[i]) - 1);
    if ((seen & bit) == 0u && crossings.medium[i] < 0) {
      inside |= bit;
    }
    seen |= bit;
  }
  inside |= crossings.dropped & ~seen;
#ifdef MEDIA_APART
  media_see();
  inside &= media_seen;
#endif
  return inside;
}

// A ray is a row of intervals between crossings.
int media_intervals()
{
  return crossings.count + 1 + ((crossings.beyond > 0.0) ? 1 : 0);
}

// Where interval i ends, at most at `limit`.
float media_until(int i, float limit)
{
  float end = (i < crossings.count) ? crossings.t[min(i, MOST_CROSSINGS - 1)] : (i == crossings.count && crossings.beyond > 0.0) ? crossings.beyond : limit;
  return min(end, limit);
}

// Media behind interval i, which lies in `inside`.
uint media_behind(int i, uint inside)
{
  int crossing = crossings.medium[min(i, MOST_CROSSINGS - 1)];
  uint bit = 1u << uint(max(abs(crossing), 1) - 1);
  uint behind = (i >= crossings.count) ? (inside ^ crossings.dropped) : ((crossing > 0) ? (inside | bit) : (inside & ~bit));
#ifdef MEDIA_APART
  behind &= media_seen;
#endif
  return behind;
}
