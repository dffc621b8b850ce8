// Penumbra wedge blending: the share of a light that casters leave, from the areas that their edges cut off, without noise.
//
// Group by group (a connected island of one object), the hidden area of each quarter of the light and the box around it are
// summed up over the edges: those that the receiver sees from the lit side add, the others take away from what the centre
// alone would give. A group is then joined to what was hidden before. With UNION_BOXES their overlap is estimated from the
// boxes, each as evenly filled as its area says; UNION_SUM takes none, UNION_PRODUCT takes groups for independent.
//
// Source: Forest, Barthe, Paulin, "Realistic soft shadows by penumbra-wedges blending", Graphics Hardware 2006. The area in
// closed form, the box without order and weights from the receiver are ours.
#include "lib/math.glsl"
#include "edges/light.glsl"
#include "edges/edge_record.glsl"
#include "edges/samples.glsl"
#include "edges/penumbra.glsl"

#define LEAST_AREA 1e-4  // of a quarter: rounding of areas is less
#define NO_BORDER 1e-4
#define COUNT_BIAS 96.0

uint word_of(int index)
{
  return tile_words_fetch(ivec2(index & 2047, index >> 11)).x;
}

// Layers of a group before the light's centre, from the digits of base 256 in sixteen channels.
float group_layers(ivec2 pixel, int slot, float layers_of_one)
{
  int image_number = slot / 12;
  vec4 counts = (image_number == 0) ? counts_a_fetch(pixel) : (image_number == 1) ? counts_b_fetch(pixel)
                : (image_number == 2) ? counts_c_fetch(pixel) : counts_d_fetch(pixel);
  int packed_digits = int(counts[(slot / 3) & 3] + 0.5);
  int digit = (packed_digits >> (8 * (slot % 3))) & 255;
  return (float(digit) - COUNT_BIAS) / layers_of_one;
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
  ivec2 size = receivers_size();
  if (pixel.x >= size.x || pixel.y >= min(size.y, last_row)) {
    return;
  }
  vec4 receiver = receivers_fetch(pixel);
  float share = 1.0;
  vec3 p = receiver.xyz;
  vec3 c = towards_centre(p);
  vec3 half_u = rectangle_u;
  vec3 half_v = rectangle_v;
  vec3 plane = edge_light.axis.xyz;
  if (edge_light.shape != IN_PLANE) {
    // A square of the disc's area that faces the receiver.
    LightFrame f = light_frame(c);
    half_u = f.u * 0.886227;
    half_v = f.v * 0.886227;
    plane = f.axis;
  }
  float height = dot(c, plane);
  bool lit_side = light_at_infinity() || edge_light.shape != IN_PLANE || height < 0.0;
  if (receiver.w != 0.0 && lit_side) {
    vec3 to_x = half_u / max(dot(half_u, half_u), 1e-30);
    vec3 to_y = half_v / max(dot(half_v, half_v), 1e-30);
    vec3 to_z = plane / height;
    vec2 centre = vec2(dot(c, to_x), dot(c, to_y));
    float hidden_all[4];
    vec2 low_all[4];
    vec2 high_all[4];
    for (int q = 0; q < 4; q++) {
      hidden_all[q] = 0.0;
      low_all[q] = vec2(1.0);
      high_all[q] = vec2(0.0);
    }
    float plain_sum = 0.0;
    float product = 1.0;
    ivec2 tile = pixel / TILE;
    int base = (tile.x + tile.y * edge_light.tile_columns) * edge_light.word_count;
    for (int g = 0; g < edge_light.group_count; g++) {
      vec4 group = groups_fetch(ivec2(g, 0));  // first edge, end, triangles of one layer
      float layers = group_layers(pixel, g, group.z);
      bool behind = layers > 0.25;
      float hidden[4];
      float border[4];
      vec2 low[4];
      vec2 high[4];
      vec2 farthest[4];
      for (int q = 0; q < 4; q++) {
        hidden[q] = layers;
        border[q] = 2.0 * layers;
        low[q] = vec2(behind ? 0.0 : 1.0);
        high[q] = vec2(behind ? 1.0 : 0.0);
        farthest[q] = vec2(0.0);
      }
      bool touched = behind;
      int first = int(group.x);
      int end = int(group.y);
      for (int w = first >> 5; w <= (end - 1) >> 5; w++) {
        uint word = word_of(base + w);
        int start = max(first - 32 * w, 0);
        int stop = min(end - 32 * w, 32);
        word &= 0xffffffffu << uint(start);
        word &= (stop < 32) ? (1u << uint(stop & 31)) - 1u : 0xffffffffu;
        while (word != 0u) {
          int bit = findLSB(word);
          word &= word - 1u;
          int record = 4 * (32 * w + bit);
          vec4 v0 = edge_texel(record);
          vec4 v1 = edge_texel(record + 1);
          vec3 a = v0.xyz - p;
          vec3 b = v1.xyz - p;
          float n_centre = centre_side(a, b, c);
          if (abs(n_centre) > edge_light.size.x * length(cross(a, b))) {
            continue;
          }
          int weight = edge_weight(record, v0, v1, p);
          if (weight == 0) {
            continue;
          }
          float turn = float((n_centre >= 0.0) ? weight : -weight) / group.z;
          vec3 from = vec3(dot(a, to_x), dot(a, to_y), dot(a, to_z));
          vec3 to = vec3(dot(b, to_x), dot(b, to_y), dot(b, to_z));
          from.xy -= centre * from.z;
          to.xy -= centre * to.z;
          if (!clip_edge(from, to, from.z - 1e-6, to.z - 1e-6)) {
            continue;
          }
          if (!light_at_infinity() && !clip_edge(from, to, 1.0 - from.z, 1.0 - to.z)) {
            continue;
          }
          for (int q = 0; q < 4; q++) {
            vec3 s = from;
            vec3 t = to;
            if (!clip_to_quarter(s, t, vec2(((q & 1) != 0) ? -1.0 : 1.0, ((q & 2) != 0) ? -1.0 : 1.0))) {
              continue;
            }
            vec2 at_s = clamp(s.xy / max(s.z, 1e-20), vec2(0.0), vec2(1.0));
            vec2 at_t = clamp(t.xy / max(t.z, 1e-20), vec2(0.0), vec2(1.0));
            if (max(at_s.x, at_s.y) <= 1e-7 || max(at_t.x, at_t.y) <= 1e-7) {
              continue;  // its sector is not defined, and holds nothing
            }
            hidden[q] += turn * area_beyond(at_s, at_t);
            border[q] += turn * abs(swept_border(at_s) - swept_border(at_t));
            farthest[q] = max(farthest[q], max(at_s, at_t));
            if (turn > 0.0) {
              low[q] = min(low[q], min(at_s, at_t));
              high[q] = max(high[q], far_corner(at_s, at_t));
            }
            touched = true;
          }
        }
      }
      if (!touched) {
        continue;
      }
      float of_group = 0.0;
      for (int q = 0; q < 4; q++) {
        float area = clamp(hidden[q], 0.0, 1.0);
        of_group += 0.25 * area;
        if (area < LEAST_AREA) {
          continue;
        }
        vec2 high_own = (border[q] < NO_BORDER) ? min(high[q], farthest[q]) : high[q];
        vec2 side = max(high_own - low[q], vec2(0.0));
        float box = max(side.x * side.y, area);
        float joined = area;
        if (hidden_all[q] > 0.0) {
          vec2 side_all = max(high_all[q] - low_all[q], vec2(0.0));
          float box_all = max(side_all.x * side_all.y, hidden_all[q]);
          vec2 common_part = max(min(high_own, high_all[q]) - max(low[q], low_all[q]), vec2(0.0));
          joined += hidden_all[q] - (hidden_all[q] / box_all) * (area / box) * common_part.x * common_part.y;
        }
        hidden_all[q] = clamp(joined, 0.0, 1.0);
        low_all[q] = min(low_all[q], low[q]);
        high_all[q] = max(high_all[q], high_own);
      }
      plain_sum += of_group;
      product *= 1.0 - of_group;
    }
#if defined(UNION_SUM)
    share = clamp(1.0 - plain_sum, 0.0, 1.0);
#elif defined(UNION_PRODUCT)
    share = clamp(product, 0.0, 1.0);
#else
    share = clamp(1.0 - 0.25 * (hidden_all[0] + hidden_all[1] + hidden_all[2] + hidden_all[3]), 0.0, 1.0);
#ifdef CARDS
    // Each point that cards hide takes what solids leave of it: all outside of their box, else as they fill that.
    LightFrame facing = light_frame(c);
    vec3 u = (card_shape == IN_PLANE) ? edge_light.half_u.xyz : facing.u;
    vec3 v = (card_shape == IN_PLANE) ? edge_light.half_v.xyz : facing.v;
    int own_pattern = ((pixel.x & 3) + 4 * (pixel.y & 3)) % card_patterns;
    uvec2 seen = uvec2(card_points_fetch(pixel).x, card_points_fetch(pixel + ivec2(0, size.y)).x);
    float taken = 0.0;
    for (int k = 0; k < 64; k++) {
      if ((((k < 32) ? seen.x : seen.y) & (1u << uint(k & 31))) != 0u) {
        continue;
      }
      vec4 pair = light_pattern_fetch(ivec2(k >> 1, own_pattern));
      vec2 along = ((k & 1) == 0) ? pair.xy : pair.zw;
      vec3 offset = along.x * u + along.y * v;
      vec2 place = vec2(dot(offset, to_x), dot(offset, to_y));
      int q = ((place.x < 0.0) ? 1 : 0) + ((place.y < 0.0) ? 2 : 0);
      vec2 inside = min(abs(place), vec2(1.0));
      vec2 side = max(high_all[q] - low_all[q], vec2(0.0));
      bool boxed = all(greaterThanEqual(inside, low_all[q])) && all(lessThanEqual(inside, high_all[q]));
      taken += boxed ? 1.0 - hidden_all[q] / max(side.x * side.y, max(hidden_all[q], 1e-6)) : 1.0;
    }
    share = clamp(share - taken / 64.0, 0.0, 1.0);
#endif
#endif
  }
#ifdef CARDS
#if defined(UNION_SUM)
  share = clamp(share + cards_share_fetch(pixel).x - 1.0, 0.0, 1.0);
#elif defined(UNION_PRODUCT)
  share *= cards_share_fetch(pixel).x;
#endif
#endif
  imageStore(seen_share, pixel + ivec2(0, edge_light.picture_row), vec4(share, 0.0, 0.0, 0.0));
}
