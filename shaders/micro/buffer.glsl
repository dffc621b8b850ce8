// A micro-buffer: the hemisphere above a place, cosine-weighted, as micro_side x micro_side pixels of an image of integers,
// each of which has the depth of what it meets first in its high bits, by the logarithm, and below them which side of which
// node of the tree that is. Filled by one thread, which goes through the tree of discs (addon/scene/point_tree.py) without
// a stack.
//
// Ritschel 2009, chapter 6.3. There a node smaller than a pixel fills the pixel that its middle falls into, and pixels that
// larger leaves cover cast rays afterwards. Here every node is drawn by rays through the middles of pixels (`centre_test`):
// what a node's ball holds between the middles is left out with all that is below it, and silhouettes do not grow.
//
// Binds `tree_nodes`, `piece_clips`, `node_radiance`, the image `micro`; constants part, micro_side, leaf_count, id_bits, detail, centre_test, log_depths.
//
// With GLOSSY the pixels are equal shares of what microfacets reflect to the viewer instead: each has a ray of the lobe, and
// nodes beside the cone about all rays are left out.
#include "micro/frame.glsl"
#define NOTHING 0xffffffffu
#define ROUND 0.2  // of the size of a flat group that is drawn as one disc: up to there a bent one is drawn as a ball
#define ITSELF 1e-3  // half lengths of a piece within which what is seen of it is where one looks from
#define SEAM 1e-4    // half lengths by which pieces overlap, so that rounding leaves no gap
#define LONG 2.0      // pixels that what is flat and seen from aside may be long
#define DISC_AREA 1.4 // of the square of a flat group's disc: PI / COVER^2 of addon/scene/point_tree.py
#define LEVEL 2e-3  // radii that a node must rise above the plane of the place: less is rounding
#define SAME_SURFACE 0.7  // cosine between normals, from which on a disc whose radius reaches here is this surface

vec4 node_texel(int index)
{
  return tree_nodes_fetch(ivec2(index & 2047, index >> 11));
}

void micro_store(ivec2 texel, float depth, int node, bool behind)
{
  float last = float(NOTHING >> uint(id_bits)) - 1.0;
  float share = clamp((log2(max(depth, 1e-30)) - log_depths.x) / (log_depths.y - log_depths.x), 0.0, 1.0);
  uint word = (uint(share * last) << uint(id_bits)) | (2u * uint(node) + (behind ? 1u : 0u));
  if (word < imageLoad(micro, texel).x) {
    imageStore(micro, texel, uvec4(word));
  }
}

// The node whose light a place on a piece sends: its own, or beyond a line on which something stands that of a piece beside it,
// 0 for none (micro/clips.frag.glsl).
int lit_node(int node, bool behind, vec2 at)
{
  int entry = 2 * (node - leaf_count) + (behind ? 1 : 0);
  vec4 clips = piece_clips_fetch(ivec2(entry % POINT_ROW, entry / POINT_ROW));
  vec2 turned = floor(clips.xz / TURN + 0.5);
  vec2 angle = clips.xz - TURN * turned;
  bool first = dot(at, vec2(cos(angle.x), sin(angle.x))) > clips.y;
  if (!first && dot(at, vec2(cos(angle.y), sin(angle.y))) <= clips.w) {
    return node;
  }
  int bits = int(first ? turned.x : turned.y);
  return (bits > 0) ? leaf_count + ((node - leaf_count) ^ bits) : 0;
}

// A point's piece of a triangle or disc, a flat group's rectangle or a bent one's ball, into the pixels `low` to `high` whose
// middles see it.
void micro_draw(MicroFrame f, ivec2 corner, ivec2 low, ivec2 high, vec3 to_node, vec4 shape, int node)
{
  vec3 axis = octahedral_decode(shape.xy);
  float squared = shape.w * shape.w;
  float off_plane = dot(to_node, axis);
  bool piece = shape.z < 0.0;
  bool flat_group = node < leaf_count && !piece && shape.w > 0.0;
  vec4 sides = (flat_group || piece) ? node_texel(3 * node + 2) : vec4(0.0);
  vec3 along = octahedral_decode(sides.xy);
  vec3 across = cross(axis, along);
  // A smooth surface bends away below the disc beside it.
  bool same = node >= leaf_count && abs(dot(axis, f.normal)) > SAME_SURFACE;
  float nearest = piece ? ITSELF * shape.w : (same ? shape.w : 0.0);
  int width = high.x - low.x + 1;
  int count = width * (high.y - low.y + 1);
  for (int i = 0; i < count; i++) {
    ivec2 pixel = low + ivec2(i % width, i / width);
    vec3 weight;
    vec3 ray = micro_ray(f, pixel, weight);
    float cosine = dot(ray, axis);
    float depth = (shape.w < 0.0) ? dot(to_node, ray) : off_plane / ((cosine == 0.0) ? 1e-30 : cosine);
    vec3 off = depth * ray - to_node;
    bool inside = dot(off, off) <= squared;
    if (flat_group || piece) {
      vec2 at = vec2(dot(off, along), dot(off, across));
      // Between the two edges that meet above the longest one.
      float up = at.y / sides.w;
      vec2 edges = vec2(-shape.w, shape.w) + (sides.z - vec2(-shape.w, shape.w)) * up;
      inside = flat_group ? abs(at.x) <= sides.z && abs(at.y) <= sides.w
                          : up >= -SEAM && up <= 1.0 + SEAM && at.x >= edges.x - SEAM * shape.w && at.x <= edges.y + SEAM * shape.w;
    }
    if (depth > nearest && inside && dot(ray, f.plane) > 0.0) {
      bool behind = cosine > 0.0;
      bool parted = piece && node >= leaf_count;
      int lit = parted ? lit_node(node, behind, vec2(dot(off, along), dot(off, across))) : node;
      micro_store(corner + pixel, depth, lit, behind);
    }
  }
}

// How far a node reaches above its middle along `up`: a slab of half the height `thick` within a ball.
float rise(vec3 axis, vec3 up, float radius, float thick)
{
  float cosine = dot(axis, up);
  return min(radius * sqrt(max(1.0 - cosine * cosine, 0.0)) + max(thick, 0.0) * abs(cosine), radius);
}

void micro_clear(ivec2 corner)
{
  for (int i = 0; i < micro_side * micro_side; i++) {
    imageStore(micro, corner + ivec2(i % micro_side, i / micro_side), uvec4(NOTHING));
  }
}

int node_after(int node)
{
  return (node + 1) >> findLSB(node + 1);
}

// Draw what lies below node `part.y` + `part.x` of a level that has `part.y` nodes. Threads that run together look for their
// next node first and draw it then, all at once: drawn where each one finds it, most of them would wait for one that draws.
void micro_fill(MicroFrame f, ivec2 corner)
{
  float side = float(micro_side);
  int k = part.x + part.y;
  int end = node_after(k);
  int steps = 0;
  while (steps < 4 * leaf_count) {
    int drawn = 0;  // node, 0 for none: the root is node 1
    ivec2 drawn_low = ivec2(0);
    ivec2 drawn_high = ivec2(0);
    vec3 drawn_to = vec3(0.0);
    vec4 drawn_shape = vec4(0.0);
    while (steps < 4 * leaf_count && drawn == 0) {
      steps += 1;
      vec4 ball = node_texel(3 * k);
      vec3 to_node = ball.xyz - f.place;
      bool down = false;
      float height = min(dot(to_node, f.normal), dot(to_node, f.plane));
      bool above = height > -ball.w;
      if (above && height < ball.w) {  // what lies in the plane of the place does not rise above it
        vec4 shape = node_texel(3 * k + 1);
        vec3 axis = octahedral_decode(shape.xy);
        above = min(dot(to_node, f.normal) + rise(axis, f.normal, ball.w, shape.z),
                    dot(to_node, f.plane) + rise(axis, f.plane, ball.w, shape.z)) > LEVEL * ball.w;
      }
      if (above) {
        float squared = dot(to_node, to_node);
        float sine = ball.w * ball.w / max(squared, 1e-30);
        ivec2 low = ivec2(0);
        ivec2 high = ivec2(micro_side - 1);
        float reach = side;
        vec2 middle = vec2(0.0);
        if (sine < 1.0) {
          float chord = sqrt(2.0 * sine / (1.0 + sqrt(1.0 - sine)));
          vec3 direction = to_node * inversesqrt(squared);
#ifdef GLOSSY
          reach = STRETCH * chord * side / max(2.0 * f.angle, 1e-6);  // its pixels lie beside each other on the cone
          float apart = acos(clamp(dot(direction, f.axis), -1.0, 1.0));
          high = (apart > f.angle + asin(sqrt(sine))) ? ivec2(-1) : high;
#else
          reach = 0.5 * STRETCH * chord * side;
          vec2 disc = vec2(dot(direction, f.tangent), dot(direction, f.bitangent));
          middle = (square_of_disc(disc) * 0.5 + 0.5) * side - f.shift;
          vec2 half_size = square_reach(disc, chord) * (0.5 * side);
          low = max(low, ivec2(ceil(middle - half_size)));
          high = min(high, ivec2(floor(middle + half_size)));
#endif
        }
        bool small_enough = reach <= detail;
        bool seen = low.x <= high.x && low.y <= high.y;
        if (centre_test == 0 && small_enough && dot(to_node, f.normal) > 0.0) {
          ivec2 pixel = clamp(ivec2(floor(middle + f.shift)), ivec2(0), ivec2(micro_side - 1));
          vec4 shape = node_texel(3 * k + 1);
          micro_store(corner + pixel, sqrt(squared), k, dot(to_node, octahedral_decode(shape.xy)) > 0.0);
        }
        else if (seen || centre_test == 0) {
          // A ball in place of an edge between walls lets light pass beside it; what is flat counts by its solid angle.
          vec4 shape = node_texel(3 * k + 1);
          bool bent = shape.w < 0.0;
          bool drawable = small_enough && !(bent && reach > ROUND * detail);
          if (k < leaf_count && !bent && !small_enough && reach < LONG * detail) {
            float area = (shape.z < 0.0) ? -shape.z * shape.w : DISC_AREA * shape.w * shape.w;
            float slant = abs(dot(to_node, octahedral_decode(shape.xy))) * max(dot(to_node, f.normal), 0.0);
            drawable = area * slant * side * side <= PI * (detail * detail / 0.6561) * squared * squared;
          }
          down = k < leaf_count && !drawable;
          if (!down) {
            drawn = k;
            drawn_low = low;
            drawn_high = high;
            drawn_to = to_node;
            drawn_shape = shape;
          }
        }
      }
      k = down ? 2 * k : node_after(k);
      steps = (k == end) ? 4 * leaf_count : steps;
    }
    if (drawn != 0) {
      micro_draw(f, corner, drawn_low, drawn_high, drawn_to, drawn_shape, drawn);
    }
  }
}

vec4 radiance_texel(uint index)
{
  return node_radiance_fetch(ivec2(int(index & 2047u), int(index >> 11u)));
}
