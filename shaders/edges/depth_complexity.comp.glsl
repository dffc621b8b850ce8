// Depth complexity sampling: exact numbers of layers between a receiver and POINTS points of a light.
//
// Counters stand in bit planes, one bit of each per point, and count modulo 2^PLANES in two's complement: an edge adds its
// weight to all points that it hides at once. Without BITS the share of the light that is seen is written, each point
// weighted by what it would bring to a Lambertian surface; with BITS the points that are seen, 32 to a texel, one image
// above the other.
//
// Source: Forest, Barthe, Paulin, "Accurate shadows by depth complexity sampling", CGF 27(2), 2008. The predicate on the
// triangle (receiver, centre, point), weights as seen from the receiver, and counters in planes are ours.
#include "lib/math.glsl"
#include "edges/light.glsl"
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
#define HIT(number) half_hit |= hidden_point(number, own_pattern, f, n_centre, n, k0, k1, q);
#define ADD(number) next = (plane[number] ^ turn) & carry; plane[number] ^= carry; carry = next;

vec4 edge_texel(int index)
{
  return edge_records_fetch(ivec2(index & 2047, index >> 11));
}

uint word_of(int index)
{
  return tile_words_fetch(ivec2(index & 2047, index >> 11)).x;
}

// The bit of point `k` where the edge lies in the triangle (receiver, centre, point). `n`: normal of the plane through the
// receiver and the edge, on whose side n_centre the centre lies; k0, k1, q: of the planes through the receiver, the centre
// and either end, and of that through the centre and the edge.
uint hidden_point(int k, int own_pattern, LightFrame f, float n_centre, vec3 n, vec3 k0, vec3 k1, vec3 q)
{
  vec3 offset = light_offset(f, light_pattern_fetch(ivec2(k, own_pattern)).xyz);
  bool side = n_centre >= 0.0;
  bool crossed = ((n_centre + dot(n, offset) >= 0.0) != side) && ((dot(k0, offset) >= 0.0) != (dot(k1, offset) >= 0.0))
                 && ((dot(q, offset) >= 0.0) == side);
  return crossed ? (1u << uint(k & 31)) : 0u;
}

#ifdef CARDS
// The bit of point `k` where it is still seen (bits of its half) and the card hides it.
uint covered_point(int k, uint half_seen, int own_pattern, LightFrame f, Card card, CardView view, vec3 c, ivec2 pixel)
{
  uint one = 1u << uint(k & 31);
  if ((half_seen & one) == 0u) {
    return 0u;
  }
  vec3 offset = light_offset(f, light_pattern_fetch(ivec2(k, own_pattern)).xyz);
  return card_hides(card, view, c + offset, pixel, k) ? one : 0u;
}
#define COVER(number) half_seen &= ~covered_point(number, half_seen, own_pattern, f, card, view, c, pixel);
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
  int own_pattern = ((pixel.x & 3) + 4 * (pixel.y & 3)) % edge_light.pattern_count;
  vec3 p = receiver.xyz;
  vec3 c = towards_centre(p);
  LightFrame f = light_frame(c);
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
#ifdef STANDARD
        int weight = -int(v1.w);
#else
        int code = int(v0.w);
        int first = code - 3 * (code / 3) - 1;
        int second = code / 3 - 1;
        int weight = ((plane_side(edge_texel(record + 2), p) >= 0.0) ? first : -first)
                     + ((plane_side(edge_texel(record + 3), p) >= 0.0) ? second : -second);
#endif
        if (weight == 0) {
          continue;
        }
        vec3 k0 = cross(a, c);
        vec3 k1 = cross(b, c);
        vec3 along = v1.xyz - v0.xyz;
        vec3 q = cross(along, light_at_infinity() ? c : edge_light.centre.xyz - v0.xyz);
        bool side = n_centre >= 0.0;
        uvec2 hit = uvec2(0u);
        for (int k = 0; k < POINTS; k += 16) {
          uint half_hit = 0u;
          HIT(k) HIT(k + 1) HIT(k + 2) HIT(k + 3) HIT(k + 4) HIT(k + 5) HIT(k + 6) HIT(k + 7)
          HIT(k + 8) HIT(k + 9) HIT(k + 10) HIT(k + 11) HIT(k + 12) HIT(k + 13) HIT(k + 14) HIT(k + 15)
          hit |= (k < 32) ? uvec2(half_hit, 0u) : uvec2(0u, half_hit);
        }
        int change = side ? weight : -weight;
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
  vec3 emission_axis = (edge_light.shape == 0) ? edge_light.axis.xyz : -f.axis;
  for (int k = 0; k < POINTS; k++) {
    vec3 ray = c + light_offset(f, light_pattern_fetch(ivec2(k, own_pattern)).xyz);
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
