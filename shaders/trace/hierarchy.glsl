// Nearest hit of a ray in the bounding volume hierarchy of addon/scene/acceleration.py.
//
// Where some triangles are opaque place by place, OPACITY_TILES is defined (the image of the leaves sees to it).
//
// Where meshes have trees of their own, INSTANCED is defined: leaves of the upper tree are records of instances, which lead
// a ray into a mesh's tree, in the mesh's own space. There its direction is not of length one, so that distances stay those
// of the world. Such hits hold the node number of the record above the slot's two bits.
//
// The tree is four-wide. A stack holds nodes of which some children are still to visit, and those children as four bits. Its
// top is a number of its own, `top`, since most entries are taken off before another is put on them.
#include "lib/math.glsl"
#include "lib/random.glsl"

#define NODE_TEXELS 4
#ifdef INSTANCED
#define DEEPEST 66  // nodes above each other, in two trees
#else
#define DEEPEST 32  // as in addon/scene/box_tree.py
#endif
#define LEAF_TEXELS 17
#define OPACITY_TEXEL 9  // opacity_of_four
#define SIDES 2048.0     // one more than what an opaque side has
#define MAPPED 4.0       // from here on a code tells of a tile
// Number of its material, and above the object's groups of light linking; .25 more or less: the triangle emits to its front
// or to its back alone.
#define MATERIAL_TEXEL 13
#define MATERIAL_BITS 14
#define NORMAL_TEXEL 14
#ifdef INSTANCED
#define HIT_SLOT(hit) (hit.y & 3)
#define HIT_RECORD(hit) (hit.y >> 2)
#define BOTTOM bottom  // of the stack: what lies below belongs to the upper tree
#else
#define HIT_SLOT(hit) hit.y
#define BOTTOM 0
#endif

vec4 node_texel(int index)
{
  return trace_nodes_fetch(ivec2(index & 2047, index >> 11));
}

vec4 leaf_texel(int index)
{
  return trace_leaves_fetch(ivec2(index & 2047, index >> 11));
}

// Four triangles of a leaf: a corner of each and two edges from there, by axis.
struct Four {
  vec4 x;
  vec4 y;
  vec4 z;
  vec4 e1x;
  vec4 e1y;
  vec4 e1z;
  vec4 e2x;
  vec4 e2y;
  vec4 e2z;
};

Four four_read(int leaf)
{
  int base = leaf * LEAF_TEXELS;
  Four f;
  f.x = leaf_texel(base);
  f.y = leaf_texel(base + 1);
  f.z = leaf_texel(base + 2);
  f.e1x = leaf_texel(base + 3);
  f.e1y = leaf_texel(base + 4);
  f.e1z = leaf_texel(base + 5);
  f.e2x = leaf_texel(base + 6);
  f.e2y = leaf_texel(base + 7);
  f.e2z = leaf_texel(base + 8);
  return f;
}

// Distances to four triangles at once (Moeller & Trumbore 1997); 1e30 where missed. `facing`: above 0 where the corners
// run anticlockwise, seen from the origin.
vec4 intersect_four(Four f, vec3 origin, vec3 direction, out vec4 facing)
{
  vec4 px = direction.y * f.e2z - direction.z * f.e2y;
  vec4 py = direction.z * f.e2x - direction.x * f.e2z;
  vec4 pz = direction.x * f.e2y - direction.y * f.e2x;
  vec4 determinant = f.e1x * px + f.e1y * py + f.e1z * pz;
  vec4 inverse = vec4(1.0) / mix(determinant, vec4(1.0), equal(determinant, vec4(0.0)));
  vec4 tx = origin.x - f.x;
  vec4 ty = origin.y - f.y;
  vec4 tz = origin.z - f.z;
  vec4 u = (tx * px + ty * py + tz * pz) * inverse;
  vec4 qx = ty * f.e1z - tz * f.e1y;
  vec4 qy = tz * f.e1x - tx * f.e1z;
  vec4 qz = tx * f.e1y - ty * f.e1x;
  vec4 v = (direction.x * qx + direction.y * qy + direction.z * qz) * inverse;
  vec4 t = (f.e2x * qx + f.e2y * qy + f.e2z * qz) * inverse;
  bvec4 inside = lessThanEqual(max(max(-u, -v), max(u + v - vec4(1.0), -t)), vec4(0.0));
  t = mix(vec4(1e30), t, inside);
  facing = determinant;
  return mix(t, vec4(1e30), equal(determinant, vec4(0.0)));
}

#ifdef INSTANCED
// Records of instances lie among the nodes, two nodes long: the rows that take places into the mesh's space; the root of
// its tree, which of the hierarchy's instances it is, and -1 where it is mirrored; the rows of the way back.
vec3 record_turned(int record, vec3 v)
{
  int base = record * NODE_TEXELS;
  return vec3(dot(node_texel(base).xyz, v), dot(node_texel(base + 1).xyz, v), dot(node_texel(base + 2).xyz, v));
}

vec3 record_placed(int record, vec3 position)
{
  int base = record * NODE_TEXELS;
  vec4 p = vec4(position, 1.0);
  return vec3(dot(node_texel(base), p), dot(node_texel(base + 1), p), dot(node_texel(base + 2), p));
}
#endif

// The first corner of a triangle and its two edges.
void triangle_edges(ivec2 hit, out vec3 corner, out vec3 e1, out vec3 e2)
{
  int base = hit.x * LEAF_TEXELS;
  int k = HIT_SLOT(hit);
  corner = vec3(leaf_texel(base)[k], leaf_texel(base + 1)[k], leaf_texel(base + 2)[k]);
  e1 = vec3(leaf_texel(base + 3)[k], leaf_texel(base + 4)[k], leaf_texel(base + 5)[k]);
  e2 = vec3(leaf_texel(base + 6)[k], leaf_texel(base + 7)[k], leaf_texel(base + 8)[k]);
#ifdef INSTANCED
  if (HIT_RECORD(hit) != 0) {
    int back = HIT_RECORD(hit) + 1;  // the second half of the record
    corner = record_placed(back, corner);
    e1 = record_turned(back, e1);
    e2 = record_turned(back, e2);
  }
#endif
}

// How far a place on a triangle is along its two edges.
vec2 triangle_place(ivec2 hit, vec3 position)
{
  vec3 corner;
  vec3 e1;
  vec3 e2;
  triangle_edges(hit, corner, e1, e2);
  vec3 across = cross(e1, e2);
  vec3 offset = position - corner;
  return vec2(dot(cross(offset, e2), across), dot(cross(e1, offset), across)) / max(dot(across, across), 1e-37);
}

#ifdef OPACITY_TILES
// Of the cell where a ray meets a triangle with a tile (addon/scene/opacity_maps.py), among those that begin at `first`.
float tile_texel(ivec2 hit, vec4 tile, int first, vec3 position)
{
  float cells = 2.0 * tile.y;
  vec2 place = triangle_place(hit, position) * cells;
  int x = int(clamp(place.x, 0.0, cells - 1.0));
  int y = int(clamp(place.y, 0.0, cells - 1.0 - float(x)));
  return leaf_texel(first + (y >> 1) * int(tile.y) + (x >> 1))[2 * (y & 1) + (x & 1)];
}

// Coverage of a triangle where a ray meets it, from the tile that its code names. `to_lamp`: glass lets more pass of light
// from lamps than of light from all sides.
float tile_opacity(ivec2 hit, float code, bool front, bool to_lamp, vec3 position)
{
  int number = int(code) >> 1;  // of tile and side: corners of an odd one run the other way round
  vec4 tile = leaf_texel(number >> 1);
  float both = tile_texel(hit, tile, int(tile.x), position);
  float level = floor(both / 256.0);
  float passing = 1.0 - ((front == ((number & 1) == 0)) ? level : both - 256.0 * level) / 255.0;
  return 1.0 - passing * (to_lamp ? tile.w : 1.0);
}
#endif

// Of a leaf's four triangles what `opacity_of_four` reads: negative where a triangle may also bend what meets it; which rays it
// is about, 0: all, 1: not those that look for a light, 2: those alone, 3: all, and those for certain (glass: those that it is a
// sheet for, by the side that they meet); and the coverage of either side, or, if MAPPED, of which tile.
vec4 opacity_codes(int leaf)
{
  return leaf_texel(leaf * LEAF_TEXELS + OPACITY_TEXEL);
}

// The share of rays that four triangles stop, by their codes, met at the distances `t`, of those before `limit`; below 0 where
// such rays do not meet them.
vec4 opacity_of_four(vec4 code, int leaf, vec4 t, float limit, vec3 origin, vec3 direction, vec4 facing, bool bent, bool shadow)
{
  vec4 stopped = floor(abs(code) / (SIDES * SIDES));
  vec4 sides = abs(code) - stopped * (SIDES * SIDES);
  vec4 front = floor(sides / SIDES);
  vec4 behind = sides - SIDES * front;
  vec4 covered = mix(behind, front, greaterThan(facing, vec4(0.0)));
  vec4 glass = vec4(lessThan(code, vec4(0.0)));
  vec4 last = vec4(equal(stopped, vec4(3.0)));
  covered = mix(covered, shadow ? front : behind, glass * (vec4(1.0) - last));
  vec4 opacity = min(covered * (1.0001 / (SIDES - 1.0)), vec4(1.0));
#ifdef OPACITY_TILES
  if (max(max(stopped.x, stopped.y), max(stopped.z, stopped.w)) >= MAPPED) {
    for (int k = 0; k < 4; k++) {
      if (stopped[k] >= MAPPED && t[k] < limit) {
        opacity[k] = tile_opacity(ivec2(leaf, k), sides[k], facing[k] > 0.0, shadow, origin + t[k] * direction);
      }
    }
    stopped -= mix(vec4(0.0), vec4(MAPPED), greaterThanEqual(stopped, vec4(MAPPED)));
  }
#endif
  if (bent) {
    opacity = mix(opacity, vec4(1.0), lessThan(code, vec4(0.0)));
  }
  opacity = mix(opacity, vec4(-1.0), equal(stopped, vec4(shadow ? 1.0 : 2.0)));
  last = vec4(equal(stopped, vec4(3.0)));
  return shadow ? mix(opacity, vec4(1.0), last * (vec4(1.0) - glass)) : opacity;
}

#ifndef OPAQUE_ONLY
// Share of rays that glass stops at these cosines, which is what it mirrors of them: Schlick's curve with the mean `even` over
// even light.
vec4 stopped_by_angle(vec4 even, vec4 cosine)
{
  vec4 straight = clamp((21.0 * even - vec4(1.0)) / 20.0, vec4(0.0), vec4(1.0));
  vec4 left = vec4(1.0) - min(cosine, vec4(1.0));
  vec4 squared = left * left;
  return straight + min(21.0 * even, vec4(1.0)) * (vec4(1.0) - straight) * squared * squared * left;
}

// The same share by angle of those of four triangles that are glass, no sheet, and have no tile.
vec4 glass_by_angle(vec4 code, Four f, vec4 facing, vec3 direction, vec4 opacity)
{
  vec4 glass = vec4(lessThan(code, vec4(0.0))) * vec4(greaterThan(code, vec4(-3.0 * SIDES * SIDES)));
  glass *= vec4(greaterThanEqual(opacity, vec4(0.0)));
  if (dot(glass, vec4(1.0)) == 0.0) {
    return opacity;
  }
  vec4 x = f.e1y * f.e2z - f.e1z * f.e2y;
  vec4 y = f.e1z * f.e2x - f.e1x * f.e2z;
  vec4 z = f.e1x * f.e2y - f.e1y * f.e2x;
  vec4 cosine = abs(facing) * inversesqrt(max((x * x + y * y + z * z) * dot(direction, direction), vec4(1e-36)));
  return mix(opacity, stopped_by_angle(opacity, cosine), glass);
}
#endif

// A place in the tree: a node, or a leaf.
struct Place {
  int index;
  bool leaf;
#ifdef INSTANCED
  bool record;  // of an instance, by the number of its node
#endif
};

// Child of a node. Those that are nodes come first, and those of either kind follow each other.
Place node_child(int node, int child)
{
  vec4 links = node_texel(node * NODE_TEXELS + 3);
  int nodes = int(links.z);
  Place place;
  place.leaf = child >= nodes;
  place.index = place.leaf ? int(links.y) + child - nodes : int(links.x) + child;
#ifdef INSTANCED
  place.record = place.leaf && links.w != 0.0;
  place.index += place.record ? child - nodes : 0;
#endif
  return place;
}

// Takes one child off the stack's top; `node` is whose.
int next_pending(inout uint top, out int node)
{
  node = int(top >> 4u);
  int child = findLSB(top & 15u);
  top ^= 1u << uint(child);
  return child;
}

bool none_pending(uint top)
{
  return (top & 15u) == 0u;
}

// Boxes of a node's four children, on a grid of 256 steps over the node: texel 0 holds the grid's corner and the exponents
// of its three steps, texels 1 and 2 the lower and upper corners of the children, three bytes (x, y, z) in each float. The
// box of a child that is not there is inverted.
struct Boxes {
  vec3 corner;
  vec3 step_size;
  uvec4 low;
  uvec4 high;
};

Boxes boxes_read(int node)
{
  vec4 frame = node_texel(node);
  uint exponents = uint(frame.w);
  Boxes b;
  b.corner = frame.xyz;
  b.step_size = vec3(uintBitsToFloat((exponents & 255u) << 23u), uintBitsToFloat((exponents & 65280u) << 15u),
                     uintBitsToFloat((exponents & 16711680u) << 7u));
  b.low = uvec4(node_texel(node + 1));
  b.high = uvec4(node_texel(node + 2));
  return b;
}

// Which of them the ray meets before `reach`, as four bits, and where it enters.
uint boxes_met(Boxes b, vec3 origin, vec3 inverse, float reach, out vec4 enter)
{
  vec3 slope = b.step_size * inverse;
  vec3 start = (b.corner - origin) * inverse;
  vec4 x0 = vec4(b.low & 255u) * slope.x + start.x;
  vec4 y0 = vec4((b.low >> 8u) & 255u) * slope.y + start.y;
  vec4 z0 = vec4(b.low >> 16u) * slope.z + start.z;
  vec4 x1 = vec4(b.high & 255u) * slope.x + start.x;
  vec4 y1 = vec4((b.high >> 8u) & 255u) * slope.y + start.y;
  vec4 z1 = vec4(b.high >> 16u) * slope.z + start.z;
  // By the ray's sign, not by min and max: the inverted box of an empty child is then never met.
  enter = max(max(inverse.x > 0.0 ? x0 : x1, inverse.y > 0.0 ? y0 : y1), max(inverse.z > 0.0 ? z0 : z1, vec4(0.0)));
  vec4 leave = min(min(inverse.x > 0.0 ? x1 : x0, inverse.y > 0.0 ? y1 : y0),
                   min(inverse.z > 0.0 ? z1 : z0, vec4(reach)));
  bvec4 met = lessThanEqual(enter, leave * 1.000001);
  return (met.x ? 1u : 0u) | (met.y ? 2u : 0u) | (met.z ? 4u : 0u) | (met.w ? 8u : 0u);
}

// Colours of layers that the last ray of trace_layers has passed: each over the chance that a ray passes it at all. Three are
// kept apart; those beyond are one, of which the nearest and the farthest distance are known. Faces of what absorbs s per metre
// are layers, too: a ray keeps exp(-s t) where it leaves a solid after t, over exp(-s t) where it has entered it; what it enters
// and does not leave absorbs up to its end.
#ifdef TINTED_LAYERS
#define LAYERS_KEPT 3
#define EMISSION_TEXEL 10
#define TINT_CODE 1000.0  // see addon/scene/traced_triangles.py
#define STAINED -2000.0    // of red: what green and blue name
vec4 layers_met[LAYERS_KEPT + 1];  // colour, distance; nearest first, the last one: all beyond
#ifdef ABSORBING_LAYERS
vec3 layers_entered[LAYERS_KEPT + 1];  // what absorbs behind it, 1/m, more than before it
vec3 layers_depth[LAYERS_KEPT + 1];    // the same times the distance
float layers_farthest;                 // distance of the farthest, m; 0: there is none
#endif

// As packed_tints of addon/scene/opacity_maps.py.
vec3 unpack_tint(float packed_tint)
{
  uint bytes = uint(packed_tint);
  vec3 root = vec3(float(bytes & 255u), float((bytes >> 8u) & 255u), float(bytes >> 16u));
  vec3 tint = root * root;
  return 3.0 * tint / max(tint.x + tint.y + tint.z, 1.0);
}

// Colour of what passes a triangle in one place, over the chance to pass, of what its leaf tells; of those that have no colour
// of their own the `mean`.
vec3 told_tint(ivec2 hit, vec3 told, vec3 position, vec3 mean)
{
#ifdef OPACITY_TILES
  if (told.y > 0.0) {
    vec4 tile = leaf_texel(int(told.y));
    return unpack_tint(tile_texel(hit, tile, int(tile.z), position));
  }
#endif
  return (told.y < 0.0) ? unpack_tint(-told.y) : mean;
}

void layers_begin()
{
#ifdef ABSORBING_LAYERS
  layers_farthest = 0.0;
#endif
  for (int k = 0; k <= LAYERS_KEPT; k++) {
    layers_met[k] = vec4(1.0, 1.0, 1.0, 1e30);
#ifdef ABSORBING_LAYERS
    layers_entered[k] = vec3(0.0);
    layers_depth[k] = vec3(0.0);
#endif
  }
}

void layers_pass(int leaf, vec4 t, float limit, vec3 origin, vec3 direction, vec4 facing, bvec4 stops, vec4 opacity)
{
  int base = leaf * LEAF_TEXELS + EMISSION_TEXEL;
  vec4 red = leaf_texel(base);
  for (int i = 0; i < 4; i++) {
    if (t[i] < limit && !stops[i] && opacity[i] >= 0.0 && red[i] <= -TINT_CODE) {
      vec3 told = vec3(red[i], leaf_texel(base + 1)[i], leaf_texel(base + 2)[i]);
      vec3 color = -told - TINT_CODE;
#ifdef ABSORBING_LAYERS
      vec3 entered = vec3(0.0);
      if (told.x == STAINED && told.z != 0.0) {
        int record = int(abs(told.z));
        color = leaf_texel(record + 1).rgb;
        entered = leaf_texel(record).rgb * (((facing[i] > 0.0) == (told.z > 0.0)) ? 1.0 : -1.0);
      }
#endif
      if (told.x == STAINED) {
        color = told_tint(ivec2(leaf, i), told, origin + t[i] * direction, color);
      }
      vec4 layer = vec4(color, t[i]);
#ifdef ABSORBING_LAYERS
      vec3 depth = entered * t[i];
      layers_farthest = max(layers_farthest, t[i]);
#endif
      for (int k = 0; k < LAYERS_KEPT; k++) {
        if (layer.w < layers_met[k].w) {
          vec4 farther = layers_met[k];
          layers_met[k] = layer;
          layer = farther;
#ifdef ABSORBING_LAYERS
          vec3 behind = layers_entered[k];
          layers_entered[k] = entered;
          entered = behind;
          behind = layers_depth[k];
          layers_depth[k] = depth;
          depth = behind;
#endif
        }
      }
      if (layer.w < 1e29) {
        layers_met[LAYERS_KEPT].rgb *= layer.rgb;
        layers_met[LAYERS_KEPT].w = min(layers_met[LAYERS_KEPT].w, layer.w);
#ifdef ABSORBING_LAYERS
        layers_entered[LAYERS_KEPT] += entered;
        layers_depth[LAYERS_KEPT] += depth;
#endif
      }
    }
  }
}

// Of those nearer than `limit`, together. What a ray without an end enters and does not leave absorbs nothing.
vec3 layers_color(float limit)
{
  vec3 color = vec3(1.0);
#ifdef ABSORBING_LAYERS
  vec3 entered = vec3(0.0);
  vec3 depth = vec3(0.0);
#endif
  for (int k = 0; k <= LAYERS_KEPT; k++) {
    if (layers_met[k].w < limit) {
      color *= layers_met[k].rgb;
#ifdef ABSORBING_LAYERS
      entered += layers_entered[k];
      depth += layers_depth[k];
#endif
    }
  }
#ifdef ABSORBING_LAYERS
  float end = (limit < 1e28) ? limit : layers_farthest;
  color *= exp(min(depth - max(entered, vec3(0.0)) * end, vec3(0.0)));
#endif
  return color;
}
#else
void layers_begin() {}

vec3 layers_color(float limit)
{
  return vec3(1.0);
}
#endif

// The nearest triangle of a leaf that stops a ray before `nearest`, which it then is, if there is one.
void leaf_met(int leaf, int record, vec3 origin, vec3 direction, uint salt, bool bent, bool shadow, inout float nearest,
              inout ivec2 hit)
{
  vec4 facing;
  Four four = four_read(leaf);
  vec4 t = intersect_four(four, origin, direction, facing);
  float best = min(min(t.x, t.y), min(t.z, t.w));
  if (best < nearest) {
    vec4 code = opacity_codes(leaf);
    vec4 opacity = opacity_of_four(code, leaf, t, nearest, origin, direction, facing, bent, shadow);
#ifdef OPAQUE_ONLY
    opacity = floor(opacity);
#else
    opacity = (bent || shadow) ? opacity : glass_by_angle(code, four, facing, direction, opacity);
#endif
    uint roll = hash3(uvec3(uint(leaf), salt, 77u + uint(record))).x;
    vec4 chance = vec4(to_unit(roll), to_unit(roll * 747796405u + 1u), to_unit(roll * 2891336453u + 3u),
                       to_unit(roll * 277803737u + 7u));
    bvec4 stops = lessThan(chance, opacity);
    vec4 passed = t;
    t = mix(vec4(1e30), t, stops);
    best = min(min(t.x, t.y), min(t.z, t.w));
#ifdef TINTED_LAYERS
    layers_pass(leaf, passed, min(nearest, best), origin, direction, facing, stops, opacity);
#endif
    if (best < nearest) {
      nearest = best;
      hit = ivec2(leaf, (record << 2) + ((best == t.x) ? 0 : (best == t.y) ? 1 : (best == t.z) ? 2 : 3));
    }
  }
}

// Distance along the unit `direction` to the nearest triangle before `limit`, or `limit`; `hit` is its leaf and its
// number there. A triangle nearer than `enough` ends the search at once, whether or not it is the nearest.
// Triangles with an opacity below one are passed at random, the same way for the same `salt`; those that may bend light
// are met for certain where `bent`. `shadow`: the ray looks for a light. With OPAQUE_ONLY what is not opaque is passed:
// for lookups whose depth maps already chose at random.
float trace_layers(vec3 origin, vec3 direction, float limit, float enough, uint salt, bool bent, bool shadow,
                   out ivec2 hit)
{
  hit = ivec2(-1);
#ifdef TINTED_LAYERS
  layers_begin();
#endif
  vec3 inverse = vec3(1.0) / mix(direction, vec3(1e-20), equal(direction, vec3(0.0)));
  float nearest = limit;
  Place place;
  place.index = 0;
  place.leaf = false;
#ifdef INSTANCED
  place.record = false;
  vec3 world_origin = origin;
  vec3 world_direction = direction;
  int inside = 0;  // record of the instance that the ray is in
  int bottom = 0;
#endif
  uint pending[DEEPEST];  // node, and as its last four bits the children still to visit
  int height = 0;
  uint top = 0u;
  for (int round = 0; round < 4096; round++) {
    // Down to a leaf, nearest child first; then all rays of a group test triangles together.
    bool more = true;
    while (more && !place.leaf) {
      vec4 enter;
      uint met = boxes_met(boxes_read(place.index * NODE_TEXELS), origin, inverse, nearest, enter);
      int node = place.index;
      int child = 0;
      if (met != 0u) {
        enter = mix(vec4(1e38), enter, notEqual(uvec4(met) & uvec4(1u, 2u, 4u, 8u), uvec4(0u)));
        vec2 pair = min(enter.xy, enter.zw);
        float first = min(pair.x, pair.y);
        child = (enter.x == first) ? 0 : (enter.y == first) ? 1 : (enter.z == first) ? 2 : 3;
        met &= ~(1u << uint(child));
        if (met != 0u) {
          if (!none_pending(top)) {
            pending[height] = top;
            height++;
          }
          top = (uint(node) << 4u) | met;
        }
      }
      else if (!none_pending(top)) {
        child = next_pending(top, node);
        if (none_pending(top) && height > BOTTOM) {
          height--;
          top = pending[height];
        }
      }
      else {
        more = false;
      }
      if (more) {
        place = node_child(node, child);
      }
    }
#ifdef INSTANCED
    // Into an instance, and out again, here, where rays of a group are together.
    if (more && place.record) {
      if (!none_pending(top)) {
        pending[height] = top;
        height++;
      }
      top = 0u;
      bottom = height;
      inside = place.index;
      origin = record_placed(inside, world_origin);
      direction = record_turned(inside, world_direction);
      inverse = vec3(1.0) / mix(direction, vec3(1e-20), equal(direction, vec3(0.0)));
      place.index = int(node_texel(inside * NODE_TEXELS + 3).x);
      place.leaf = false;
      continue;
    }
    if (more) {
      leaf_met(place.index, inside, origin, direction, salt, bent, shadow, nearest, hit);
    }
#else
    if (!more) {
      break;
    }
    leaf_met(place.index, 0, origin, direction, salt, bent, shadow, nearest, hit);
#endif
    if (nearest < enough) {
      break;
    }
#ifdef INSTANCED
    if (none_pending(top) && inside != 0) {
      inside = 0;
      bottom = 0;
      origin = world_origin;
      direction = world_direction;
      inverse = vec3(1.0) / mix(direction, vec3(1e-20), equal(direction, vec3(0.0)));
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
  return nearest;
}

float trace_until(vec3 origin, vec3 direction, float limit, float enough, uint salt, out ivec2 hit)
{
  return trace_layers(origin, direction, limit, enough, salt, false, false, hit);
}

// The same for a ray that looks for a light.
float trace_shadow(vec3 origin, vec3 direction, float limit, uint salt, out ivec2 hit)
{
  return trace_layers(origin, direction, limit, limit, salt, false, true, hit);
}

float trace_nearest(vec3 origin, vec3 direction, float limit, uint salt, out ivec2 hit)
{
  return trace_until(origin, direction, limit, 0.0, salt, hit);
}

// Unit normal of a triangle.
vec3 triangle_normal(ivec2 hit)
{
  vec3 corner;
  vec3 e1;
  vec3 e2;
  triangle_edges(hit, corner, e1, e2);
  return safe_normalize(cross(e1, e2));
}

// The number of a triangle's material.
int triangle_material(ivec2 hit)
{
  return int(leaf_texel(hit.x * LEAF_TEXELS + MATERIAL_TEXEL)[HIT_SLOT(hit)] + 0.5) & ((1 << MATERIAL_BITS) - 1);
}

#ifdef HIT_LINKS
// Of the object that a triangle belongs to: its groups of receivers and of blockers.
ivec2 triangle_links(ivec2 hit)
{
  int links = int(leaf_texel(hit.x * LEAF_TEXELS + MATERIAL_TEXEL)[HIT_SLOT(hit)] + 0.5) >> MATERIAL_BITS;
  return ivec2(links & 15, links >> 4);
}
#endif

// Radiance that a triangle emits (mean over its material) to where a ray along `direction` comes from; and its normal.
vec3 triangle_emission(ivec2 hit, vec3 direction, out vec3 normal)
{
  int base = hit.x * LEAF_TEXELS;
  int k = HIT_SLOT(hit);
  normal = triangle_normal(hit);
  float material = leaf_texel(base + MATERIAL_TEXEL)[k];
  float way = material - floor(material + 0.5);
#ifdef INSTANCED
  if (HIT_RECORD(hit) != 0) {
    way *= node_texel(HIT_RECORD(hit) * NODE_TEXELS + 3).z;
  }
#endif
  bool dark = way * dot(normal, direction) > 0.0;
  vec3 emission = vec3(leaf_texel(base + 10)[k], leaf_texel(base + 11)[k], leaf_texel(base + 12)[k]);
#ifdef TINTED_LAYERS
  dark = dark || emission.x <= -TINT_CODE;
#endif
  return dark ? vec3(0.0) : emission;
}

// Points are drawn on emissive triangles with this density per area, over the power of all (addon/lighting/emissive_triangles.py).
float emissive_density(vec3 emission, float level)
{
  float shining = luminance(abs(emission));
  return (shining > 0.0) ? shining + level : 0.0;
}

vec3 corner_normal(ivec2 hit, int corner)
{
  vec3 normal = unpack_normal(leaf_texel(hit.x * LEAF_TEXELS + NORMAL_TEXEL + corner)[HIT_SLOT(hit)]);
#ifdef INSTANCED
  if (HIT_RECORD(hit) != 0) {
    int base = HIT_RECORD(hit) * NODE_TEXELS;
    normal = safe_normalize(normal.x * node_texel(base).xyz + normal.y * node_texel(base + 1).xyz
                            + normal.z * node_texel(base + 2).xyz);
  }
#endif
  return normal;
}

// Unit shading normal of a triangle where a ray meets it, interpolated between its corners.
vec3 triangle_shading_normal(ivec2 hit, vec3 position)
{
  vec2 place = triangle_place(hit, position);
  vec3 normal = (1.0 - place.x - place.y) * corner_normal(hit, 0) + place.x * corner_normal(hit, 1)
                + place.y * corner_normal(hit, 2);
  return safe_normalize(normal);
}

// Whether a triangle may bend rays: is glass.
bool triangle_is_glass(ivec2 hit)
{
  return opacity_codes(hit.x)[HIT_SLOT(hit)] < 0.0;
}

// The share of rays of paths that a triangle of glass, no sheet, stops at this cosine. `even`: that of even light; it is both
// where the triangle has a tile, and then stays.
float glass_stops(ivec2 hit, float cosine, inout float even)
{
  float share = even;
#ifndef OPAQUE_ONLY
  float code = -opacity_codes(hit.x)[HIT_SLOT(hit)];
  if (code < 3.0 * SIDES * SIDES) {
    even = mod(code, SIDES) / (SIDES - 1.0);
    share = stopped_by_angle(vec4(even), vec4(cosine)).x;
  }
#endif
  return share;
}

// Whether it is glass that is no closed solid.
bool triangle_is_sheet(ivec2 hit)
{
  float code = leaf_texel(hit.x * LEAF_TEXELS + OPACITY_TEXEL)[HIT_SLOT(hit)];
  return code < 0.0 && floor(-code / (SIDES * SIDES)) == 3.0;
}

// And a ray meets it from within.
bool leaves_sheet(ivec2 hit, vec3 position, vec3 direction)
{
  return triangle_is_sheet(hit) && dot(triangle_shading_normal(hit, position), direction) > 0.0;
}
