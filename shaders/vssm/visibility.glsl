// Visibility of a light with extent from one depth map: variance soft shadow mapping (addon/techniques/vssm.py).
//
// Whether something blocks is told by its height above the receiver's plane, in q, positive towards the light: no
// surface shadows itself. Which points of the light it hides follows from its height above the receiver's point. In a
// cell that holds only the receiver and blockers of one height h, a share f of them, mean f h and mean square f h^2
// give both:
//     f = mean^2 / square,   h = square / mean.
// This is Chebyshev's bound and the closed-form blocker depth of the source, written relative to the receiver.
#include "lib/soft_kernel.glsl"
#include "vssm/range.glsl"

#define CELL_LINES 11  // of a grid of up to 10 x 10 cells: a kernel of 2 MOST_HALF_SIZE texels
#define CELL_TEXELS 64  // widest cell whose sums fit into 32 bits

uvec4 vssm_sum(ivec2 texel)
{
  // A prefix: sums up to, not including, the texel. The table begins at the atlas' corner.
  return (min(texel.x, texel.y) <= 0) ? uvec4(0u) : depth_table_fetch(texel - 1);
}

// Texels first..last of the view, whose sum in the table is `sum`.
void vssm_cell(inout Blockers found, ShadowReceiver r, vec2 beside, ivec2 first, ivec2 last, uvec4 sum, float range, float weight)
{
  vec2 size = vec2(last - first + 1);
  vec2 centre = vec2(first) + 0.5 * size;
  float plane = r.q + dot(r.gradient, centre - r.texel);
  float tilt = 0.5 * dot(abs(r.gradient), size);
  float scale = range / (VSSM_Q * size.x * size.y);
  float mean_q = float(sum.x) * scale;
  float mean = mean_q - plane;
  float slack = r.slack + range / 16384.0;

  ivec2 middle = first + ivec2(0.5 * size);
  uvec2 column = uvec2(ivec2(r.rectangle.xy) + middle);
  vec2 moment = vec2(ivec2(sum.zw - sum.x * column)) * scale + mean_q * (vec2(middle) + 0.5 - centre);
  float mean_square = float(sum.y) * (range * range / (VSSM_SQUARED * size.x * size.y));
  float spread = dot(r.gradient * r.gradient, size * size - 1.0) / 12.0;
  float square = mean_square - 2.0 * (plane * mean_q + dot(r.gradient, moment)) + plane * plane + spread;

#ifdef MEAN_RULE
  bool lit = mean <= slack && square - mean * mean < 1e-4 * range * range;
  bool one_sided = mean > slack;
  bool blocked = false;
#else
  float deepest;
  vec2 bounds = kernel_bounds(r, first, last, deepest);
  // Nothing as high as the plane's highest texel: something lies behind the plane there, and the moments do not hold.
  float highest = plane + tilt - 0.5 * dot(abs(r.gradient), vec2(1.0)) - slack;
  bool one_sided = bounds.x >= deepest - slack && bounds.y >= highest && plane + tilt < range;
  bool lit = bounds.y <= plane - tilt + slack || (mean <= slack && one_sided);
  bool clear = bounds.x > plane + tilt + slack;  // of the receiver's plane
  bool blocked = clear && bounds.x > r.q + slack;
  lit = lit || (clear && bounds.y <= r.q + slack);
  one_sided = one_sided && !clear;
#endif
  vec2 offset = centre - r.texel;
  float base = dot(r.gradient, offset);
  if (blocked) {
    found.whole += weight;
    kernel_add(found, offset, 0.5 * size, mean + base, weight);
  }
  else if (lit) {
    found.whole += weight;
  }
  else if (one_sided) {
    // Rounding can leave a square below its least possible value, where all of the cell is blocked evenly.
    square = max(square, mean * mean);
    float share = mean * mean / square;
    found.whole += weight;
    kernel_add(found, offset, 0.5 * size, square / mean + base, weight * share);
  }
  else {
    // Something lies far behind the receiver and no bound holds: ask texels, all of a small cell.
    ivec2 asked = min(last - first + 1, ivec2((found.extent.x > 0.0) ? 2 : 3));
    vec2 apart = size / vec2(asked);
    float share = weight / float(asked.x * asked.y);
    for (int y = 0; y < asked.y; y++) {
      for (int x = 0; x < asked.x; x++) {
        kernel_texel(found, r, beside, first + ivec2((vec2(x, y) + 0.5) * apart), 0.0, share);
      }
    }
  }
}

// Adds the box r.texel -+ half_size, texels first..last of the view. When blockers are looked for the cells are even; else
// the outermost are one texel wide and count by the part of them that the box covers.
void kernel_cells(inout Blockers found, Light light, ShadowReceiver r, vec2 beside, vec2 half_size, ivec2 first, ivec2 last)
{
  bool smooth_edges = found.extent.x <= 0.0;
  vec2 low = max(r.texel - half_size, vec2(first));
  vec2 high = min(r.texel + half_size, vec2(last + 1));
  ivec2 count = last - first + 1;
  // Lines of the grid: with smooth edges, the first and the last cell are one texel wide.
  // The outline of a round light takes more of them, and so do sums that have to fit into 32 bits.
  int border = smooth_edges ? 1 : 0;
  int wished = smooth_edges ? (LIGHT_IS(light, LIGHT_RECTANGLE) ? CELLS + 1 : max(CELLS + 1, 6)) : CELLS;
  int longest = max(count.x, count.y) - 2 * border;
  int cells = max(wished, (longest + CELL_TEXELS - 1) / CELL_TEXELS + 2 * border);
  ivec2 inner_low = first + border;
  ivec2 inner = count - 2 * border;
  int inner_cells = cells - 2 * border;
  ivec2 origin = ivec2(r.rectangle.xy);
  float range = vssm_range(origin);
  uvec4 row_below[CELL_LINES];
  int bottom = first.y;
  for (int j = 0; j <= cells; j++) {
    int line_y = (j == 0) ? first.y : ((j == cells) ? last.y + 1 : inner_low.y + inner.y * (j - border) / inner_cells);
    uvec4 corner_before = uvec4(0u);
    uvec4 below_before = uvec4(0u);
    int left = first.x;
    for (int i = 0; i <= cells; i++) {
      int line_x = (i == 0) ? first.x : ((i == cells) ? last.x + 1 : inner_low.x + inner.x * (i - border) / inner_cells);
      uvec4 corner = vssm_sum(origin + ivec2(line_x, line_y));
      uvec4 below = row_below[i];
      if (j > 0 && i > 0 && line_x > left && line_y > bottom) {
        vec2 a = vec2(left, bottom);
        vec2 b = vec2(line_x, line_y);
        vec2 covered = min(b, high) - max(a, low);
        vec2 place = (0.5 * (a + b) - r.texel) / half_size;
        float weight = covered.x * covered.y * kernel_weight(light, place, 2.0 / float(inner_cells));
        weight *= kernel_cosine(found, place * half_size, 0.5 * (b - a));
        if (weight > 0.0) {
          uvec4 sum = corner - corner_before - below + below_before;
          vssm_cell(found, r, beside, ivec2(left, bottom), ivec2(line_x, line_y) - 1, sum, range, weight);
        }
      }
      row_below[i] = corner;
      corner_before = corner;
      below_before = below;
      left = line_x;
    }
    bottom = line_y;
  }
}

#include "lib/soft_visibility.glsl"
