// Depth complexity sampling: exact numbers of layers between a receiver and POINTS points of a light.
//
// Counters stand in bit planes, one bit of each per point, and count modulo 2^PLANES in two's complement: an edge adds its
// weight to all points that it hides at once. Without BITS the share of the light that is seen is written, each point
// weighted by what it would bring to a Lambertian surface; with BITS the points that are seen, 32 to a texel, one image
// above the other.
//
// Points stand in the light's plane, two to a texel, along half axes that are the light's or turn with the receiver; with
// SPACE each for itself in space. Without BITS boxes around each 16 of them follow, by which most edges ask few.
//
// Source: Forest, Barthe, Paulin, "Accurate shadows by depth complexity sampling", CGF 27(2), 2008. The predicate on the
// triangle (receiver, centre, point), weights as seen from the receiver, and counters in planes are ours.
#include "lib/math.glsl"
#include "edges/light.glsl"
#include "edges/edge_record.glsl"
#include "edges/samples.glsl"
#ifdef CARDS
#include "edges/cards.glsl"
#endif
#ifndef BITS
#include "lib/gbuffer.glsl"
#endif

#define PLANES 8

// Points are asked sixteen, or eight, in a turn of a loop: Mesa's software rasteriser ends all loops of a thread after
// 65,536 turns together, which 64 points of a thousand edges take.
#ifdef SPACE
#define HIT(number) half_hit |= hidden_point(number, own_pattern, f, edge);
#else
#define HIT(number) half_hit |= hidden_pair(number, own_pattern, edge);
#endif
#define ADD(number) next = (plane[number] ^ turn) & carry; plane[number] ^= carry; carry = next;

uint word_of(int index)
{
  return tile_words_fetch(ivec2(index & 2047, index >> 11)).x;
}

// An edge as a receiver sees it before a light. `normal`, of the plane through the receiver and the edge, on whose side n_centre
// the centre lies; k0, k1, q: of the planes through the receiver, the centre and either end, and of that through the
// centre and the edge. In the light's plane (not SPACE) along its half axes alone.
#ifdef SPACE
#define AXES vec3
#else
#define AXES vec2
#endif
struct LightEdge {
  bool side;
  float n_centre;
  AXES normal;
  AXES k0;
  AXES k1;
  AXES q;
};

// Whether the edge lies in the triangle of the receiver, the centre and a point.
bool lies_before(LightEdge edge, AXES offset)
{
  return ((edge.n_centre + dot(edge.normal, offset) >= 0.0) != edge.side)
         && ((dot(edge.k0, offset) >= 0.0) != (dot(edge.k1, offset) >= 0.0))
         && ((dot(edge.q, offset) >= 0.0) == edge.side);
}

#ifdef SPACE
// The bit of point `k` where the edge lies before it.
uint hidden_point(int k, int own_pattern, LightFrame f, LightEdge edge)
{
  vec3 offset = light_offset(f, light_pattern_fetch(ivec2(k, own_pattern)).xyz);
  return lies_before(edge, offset) ? (1u << uint(k & 31)) : 0u;
}
#else
// The bits of points `k` (even) and k + 1.
uint hidden_pair(int k, int own_pattern, LightEdge edge)
{
  vec4 pair = light_pattern_fetch(ivec2(k >> 1, own_pattern));
  uint one = 1u << uint(k & 31);
  return (lies_before(edge, pair.xy) ? one : 0u) | (lies_before(edge, pair.zw) ? (one << 1u) : 0u);
}

// Whether the edge may lie before points in a box of the pattern (middle, half sides).
bool may_hide_box(LightEdge edge, vec4 box)
{
  vec2 reach = vec2(dot(abs(edge.normal), box.zw), dot(abs(edge.q), box.zw));
  vec2 middle = vec2(edge.n_centre + dot(edge.normal, box.xy), dot(edge.q, box.xy));
  vec2 towards = edge.side ? middle : -middle;
  vec2 ends = vec2(dot(edge.k0, box.xy), dot(edge.k1, box.xy));
  vec2 ends_reach = vec2(dot(abs(edge.k0), box.zw), dot(abs(edge.k1), box.zw));
  bool between = all(greaterThan(abs(ends), ends_reach)) && (ends.x >= 0.0) == (ends.y >= 0.0);
  return towards.x <= reach.x && towards.y >= -reach.y && !between;
}
#endif

// Point `k` of the light from its centre.
vec3 point_offset(int k, int own_pattern, LightFrame f, vec3 half_u, vec3 half_v)
{
#ifdef SPACE
  return light_offset(f, light_pattern_fetch(ivec2(k, own_pattern)).xyz);
#else
  vec4 pair = light_pattern_fetch(ivec2(k >> 1, own_pattern));
  vec2 place = ((k & 1) == 0) ? pair.xy : pair.zw;
  return place.x * half_u + place.y * half_v;
#endif
}

// What holds all points of the light as a receiver sees them: a rectangle around its centre, with the inverse of its half
// axes, and of its distance along its axis (zeros: no such measure, as the receiver lies in the light's plane).
struct LightWindow {
  vec3 to_x;
  vec3 to_y;
  vec3 to_z;
  vec2 centre;
  float slack;  // of products with what is a metre away, by rounding
};

LightWindow light_window(vec3 c, vec3 half_u, vec3 half_v)
{
  vec3 plane = safe_normalize(cross(half_u, half_v));
  LightWindow w;
  float height = dot(c, plane);
  bool valid = abs(height) > 1e-4 * length(c);
  float sheared = abs(dot(half_u, half_v));
  w.to_x = half_u / max(dot(half_u, half_u) + sheared, 1e-30);
  w.to_y = half_v / max(dot(half_v, half_v) + sheared, 1e-30);
  w.to_z = valid ? plane / height : vec3(0.0);
  w.centre = vec2(dot(c, w.to_x), dot(c, w.to_y));
  w.slack = 2e-6 * (length(w.to_x) + length(w.to_y) + length(w.to_z) * (1.0 + abs(w.centre.x) + abs(w.centre.y)));
  return w;
}

// Whether an edge (its ends from the receiver) lies beyond one side of the pyramid from the receiver to the window, so that
// it can hide no point.
bool beyond_window(LightWindow w, vec3 a, vec3 b)
{
  vec3 from = vec3(dot(a, w.to_x), dot(a, w.to_y), dot(a, w.to_z));
  vec3 to = vec3(dot(b, w.to_x), dot(b, w.to_y), dot(b, w.to_z));
  from.xy -= w.centre * from.z;
  to.xy -= w.centre * to.z;
  vec2 across = max(max(min(from.xy - from.z, to.xy - to.z), min(-from.xy - from.z, -to.xy - to.z)), vec2(0.0));
  float along = light_at_infinity() ? min(-from.z, -to.z) : max(min(-from.z, -to.z), min(from.z, to.z) - 1.0);
  return max(max(across.x, across.y), along) > w.slack * max(length(a), length(b));
}

#ifdef CARDS
// The bit of point `k` where it is still seen (bits of its half) and the card hides it.
uint covered_point(int k, uint half_seen, int own_pattern, LightFrame f, vec3 half_u, vec3 half_v, Card card, CardView view, vec3 c, ivec2 pixel)
{
  uint one = 1u << uint(k & 31);
  if ((half_seen & one) == 0u) {
    return 0u;
  }
  vec3 offset = point_offset(k, own_pattern, f, half_u, half_v);
  return card_hides(card, view, c + offset, pixel, k) ? one : 0u;
}
#define COVER(number) half_seen &= ~covered_point(number, half_seen, own_pattern, f, half_u, half_v, card, view, c, pixel);
#endif

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
  ivec2 size = receivers_size();
  if (pixel.x >= size.x || pixel.y >= min(size.y, last_row)) {
    return;
  }
  vec4 receiver = receivers_fetch(pixel);
  uvec2 all = uvec2(0xffffffffu, (POINTS > 32) ? 0xffffffffu : 0u);
  if (POINTS < 32) {
    all.x = (1u << uint(POINTS & 31)) - 1u;
  }
  uvec2 seen = all;
  int own_pattern = pattern_of(pixel);
  vec3 p = receiver.xyz;
  vec3 c = towards_centre(p);
  LightFrame f = light_frame(c);
  vec3 half_u;
  vec3 half_v;
  light_axes(f, half_u, half_v);
  LightWindow window = light_window(c, half_u, half_v);
  if (receiver.w != 0.0) {
    int start = int(floor(centre_count_fetch(pixel).x + 0.5));
    uvec2 plane[PLANES];
    for (int k = 0; k < PLANES; k++) {
      plane[k] = (((start >> k) & 1) != 0) ? all : uvec2(0u);
    }
    ivec2 tile = pixel / TILE;
    int words = edge_light.word_count;
    int base = (tile.x + tile.y * edge_light.tile_columns) * words;
    for (int w = 0; w < words; w++) {
      uint word = word_of(base + w);
      while (word != 0u) {
        int bit = findLSB(word);
        word &= word - 1u;
        int record = 4 * (32 * w + bit);
        vec4 v0 = edge_texel(record);
        vec4 v1 = edge_texel(record + 1);
        vec3 a = v0.xyz - p;
        vec3 b = v1.xyz - p;
        vec3 n = cross(a, b);
        float n_centre = centre_side(a, b, c);
        if (abs(n_centre) > edge_light.size.x * length(n)) {
          continue;  // the plane through the receiver and the edge misses the light
        }
        if (beyond_window(window, a, b)) {
          continue;
        }
        int weight = edge_weight(record, v0, v1, p);
        if (weight == 0) {
          continue;
        }
        vec3 k0 = cross(a, c);
        vec3 k1 = cross(b, c);
        vec3 along = v1.xyz - v0.xyz;
        vec3 q = cross(along, light_at_infinity() ? c : edge_light.centre.xyz - v0.xyz);
        LightEdge edge;
        edge.side = n_centre >= 0.0;
        edge.n_centre = n_centre;
#ifdef SPACE
        edge.normal = n;
        edge.k0 = k0;
        edge.k1 = k1;
        edge.q = q;
#else
        edge.normal = vec2(dot(n, half_u), dot(n, half_v));
        edge.k0 = vec2(dot(k0, half_u), dot(k0, half_v));
        edge.k1 = vec2(dot(k1, half_u), dot(k1, half_v));
        edge.q = vec2(dot(q, half_u), dot(q, half_v));
#endif
        uvec2 hit = uvec2(0u);
        for (int k = 0; k < POINTS; k += 16) {
          uint half_hit = 0u;
#ifdef SPACE
          HIT(k) HIT(k + 1) HIT(k + 2) HIT(k + 3) HIT(k + 4) HIT(k + 5) HIT(k + 6) HIT(k + 7)
          HIT(k + 8) HIT(k + 9) HIT(k + 10) HIT(k + 11) HIT(k + 12) HIT(k + 13) HIT(k + 14) HIT(k + 15)
#else
#ifndef BITS
          if (!may_hide_box(edge, light_pattern_fetch(ivec2((POINTS / 2) + (k >> 4), own_pattern)))) {
            continue;
          }
#endif
          HIT(k) HIT(k + 2) HIT(k + 4) HIT(k + 6) HIT(k + 8) HIT(k + 10) HIT(k + 12) HIT(k + 14)
#endif
          hit |= (k < 32) ? uvec2(half_hit, 0u) : uvec2(0u, half_hit);
        }
        int change = edge.side ? weight : -weight;
        uvec2 carry = hit;
        int lowest = (abs(change) == 2) ? 1 : 0;
        uvec2 next;
        uvec2 turn = uvec2((change < 0) ? 0xffffffffu : 0u);
        if (lowest == 0) {
          ADD(0)
        }
        ADD(1) ADD(2) ADD(3) ADD(4) ADD(5) ADD(6) ADD(7)
      }
    }
    uvec2 hidden = uvec2(0u);
    for (int k = 0; k < PLANES; k++) {
      hidden |= plane[k];
    }
    seen = all & ~hidden;
#ifdef CARDS
    int card_base = (tile.x + tile.y * edge_light.tile_columns) * edge_light.card_word_count;
    for (int w = 0; w < edge_light.card_word_count; w++) {
      uint word = card_words_fetch(ivec2((card_base + w) & 2047, (card_base + w) >> 11)).x;
      while (word != 0u && (seen.x | seen.y) != 0u) {
        int bit = findLSB(word);
        word &= word - 1u;
        Card card = card_read(32 * w + bit);
        CardView view = card_view(card, p);
        if (!view.valid || !card_may_hide(card, p, c)) {
          continue;
        }
        for (int k = 0; k < POINTS; k += 8) {
          uint half_seen = (k < 32) ? seen.x : seen.y;
          COVER(k) COVER(k + 1) COVER(k + 2) COVER(k + 3) COVER(k + 4) COVER(k + 5) COVER(k + 6) COVER(k + 7)
          seen = (k < 32) ? uvec2(half_seen, seen.y) : uvec2(seen.x, half_seen);
        }
      }
    }
#endif
  }
#ifdef BITS
  int row = pixel.y + 2 * edge_light.picture_row;
  imageStore(seen_points, ivec2(pixel.x, row), uvec4(seen.x, 0u, 0u, 0u));
  if (POINTS > 32) {
    imageStore(seen_points, ivec2(pixel.x, row + size.y), uvec4(seen.y, 0u, 0u, 0u));
  }
#else
  float total = 0.0;
  float arriving = 0.0;
  vec3 normal = receiver.w * octahedral_decode(surface_normal_fetch(pixel).xy);
  vec3 emission_axis = (edge_light.shape == IN_PLANE) ? edge_light.axis.xyz : -f.axis;
  for (int k = 0; k < POINTS; k++) {
    vec3 ray = c + point_offset(k, own_pattern, f, half_u, half_v);
    float squared = max(dot(ray, ray), 1e-30);
    float weight = max(dot(normal, ray), 0.0);
    if (!light_at_infinity()) {
      weight *= max(-dot(emission_axis, ray), 0.0) / (squared * squared);
    }
    uint half_seen = (k < 32) ? seen.x : seen.y;
    total += weight;
    arriving += ((half_seen & (1u << uint(k & 31))) != 0u) ? weight : 0.0;
  }
  float plain = float(bitCount(seen.x) + bitCount(seen.y)) / float(POINTS);
  float share = (total > 0.0) ? arriving / total : plain;
  imageStore(seen_share, pixel + ivec2(0, edge_light.picture_row), vec4(share, 0.0, 0.0, 0.0));
#endif
}
