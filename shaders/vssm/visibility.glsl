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

#define CELL_BLOCKS (64 / TABLE_BLOCK)  // widest cell whose sums fit into 32 bits

uvec4 vssm_sum(ivec2 block)
{
  // A prefix: sums up to, not including, the block. The table begins at the atlas' corner.
  return (min(block.x, block.y) <= 0) ? uvec4(0u) : depth_table_fetch(block - 1);
}

// Texels first..last of the view, whose sum in the table is `sum`. `cosine`: mean of kernel_cosine.
void vssm_cell(inout Blockers found, ShadowReceiver r, vec2 beside, ivec2 first, ivec2 last, uvec4 sum, float range,
               float weight, float cosine)
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
  // Where all stand above the plane's middle but not above its highest texel, what the plane rises by within the cell would
  // pass for different heights.
  one_sided = one_sided && bounds.x <= plane + slack;
#endif
  vec2 offset = centre - r.texel;
  if (blocked || lit || one_sided) {
    // Rounding can leave a square below its least possible value, where all of the cell is blocked evenly.
    square = max(square, mean * mean);
    float share = blocked ? 1.0 : (lit ? 0.0 : mean * mean / square);
    float height = blocked ? mean : square / mean;
    found.whole += weight * cosine;
    if (share > 0.0) {
      kernel_add(found, offset, 0.5 * size, height + dot(r.gradient, offset), weight * cosine * share);
    }
  }
  else {
    // Something lies far behind the receiver and no bound holds: ask some texels, all of a small cell. Each stands in a
    // column of its own, and by the golden ratio in a row of its own, so that edges along either are told as finely.
    ivec2 extent = last - first + 1;
    int asked = min(extent.x * extent.y, (found.extent.x > 0.0) ? 4 : 8);
    float share = weight / float(asked);
    for (int k = 0; k < asked; k++) {
      vec2 place = vec2((float(k) + 0.5) / float(asked), fract((float(k) + 0.5) * 0.6180339887));
      ivec2 texel = first + ivec2(place * size);
      float part = share * kernel_cosine(found, vec2(texel) + 0.5 - r.texel, vec2(0.5));
      kernel_texel(found, r, beside, texel, 0.0, part);
    }
  }
}

// Adds the box r.texel -+ half_size, texels first..last of the view, by the table's blocks that it touches. When
// blockers are looked for the cells are even; else the outermost are one block wide. What the box cuts counts in part.
void kernel_cells(inout Blockers found, Light light, ShadowReceiver r, vec2 beside, vec2 half_size, ivec2 first, ivec2 last)
{
  bool smooth_edges = found.extent.x <= 0.0;
  vec2 low = max(r.texel - half_size, vec2(first));
  vec2 high = min(r.texel + half_size, vec2(last + 1));
  ivec2 block = first / TABLE_BLOCK;
  ivec2 end = last / TABLE_BLOCK + 1;
  // Lines of the grid: the outline of a round light takes more of them, and so do sums that have to fit into 32 bits.
  int border = smooth_edges ? 1 : 0;
  int wished = smooth_edges ? (LIGHT_IS(light, LIGHT_RECTANGLE) ? CELLS + 1 : max(CELLS + 1, 6)) : CELLS;
  ivec2 inner = end - block - 2 * border;
  int cells = max(wished, (max(inner.x, inner.y) + CELL_BLOCKS - 1) / CELL_BLOCKS + 2 * border);
  int inner_cells = cells - 2 * border;
  vec2 inner_cell = vec2(inner) / float(inner_cells);
  ivec2 origin = ivec2(r.rectangle.xy);
  float range = vssm_range(origin);
  ivec2 before = block;
  for (int j = 1; j <= cells; j++) {
    ivec2 line = block;
    line.y = (j == cells) ? end.y : block.y + border + int(inner_cell.y * float(j - border) + 0.01);
    // Both corners at a line are fetched again in the next row: to keep them took longer.
    uvec4 above_before = uvec4(0u);
    before.x = block.x;
    for (int i = 0; i <= cells; i++) {
      line.x = (i == 0) ? block.x : ((i == cells) ? end.x : block.x + border + int(inner_cell.x * float(i - border) + 0.01));
      ivec2 corner = origin / TABLE_BLOCK + line;
      uvec4 above = vssm_sum(corner) - vssm_sum(ivec2(corner.x, corner.y - line.y + before.y));
      if (i > 0 && all(greaterThan(line, before))) {
        vec2 a = vec2(TABLE_BLOCK * before);
        vec2 b = vec2(TABLE_BLOCK * line);
        vec2 covered = min(b, high) - max(a, low);
        vec2 place = (0.5 * (a + b) - r.texel) / half_size;
        float weight = covered.x * covered.y * kernel_weight(light, place, 2.0 / float(inner_cells));
        float cosine = kernel_cosine(found, place * half_size, 0.5 * (b - a));
        if (weight * cosine > 0.0) {
          uvec4 sum = above - above_before;
          vssm_cell(found, r, beside, TABLE_BLOCK * before, TABLE_BLOCK * line - 1, sum, range, weight, cosine);
        }
      }
      above_before = above;
      before.x = line.x;
    }
    before.y = line.y;
  }
}

#include "lib/soft_visibility.glsl"
