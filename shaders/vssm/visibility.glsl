// Visibility of a light with extent from one depth map: variance soft shadow mapping (addon/techniques/vssm.py).
//
// Whether something blocks is told by its height above the receiver's plane, in q, positive towards the light: no
// surface shadows itself. Which points of the light it hides follows from its height above the receiver's point. In a cell that holds only the
// receiver and blockers of one height h, a share f of them, mean f h and mean square f h^2 give both:
//     f = mean^2 / square,   h = square / mean.
// This is Chebyshev's bound and the closed-form blocker depth of the source, written relative to the receiver.
#include "lib/soft_kernel.glsl"
#include "vssm/range.glsl"

#define CELL_LINES 9  // of a grid of up to 8 x 8 cells
#define CELL_TEXELS 64  // widest cell whose sums fit into 32 bits
#define FEW_TEXELS 5  // up to this size of a kernel every texel is looked at

struct Blockers {
  float whole;
  float blocked;
  float height;  // above the receiver's point, summed over what is blocked
  vec2 extent;  // of the kernel per unit of height: what stands outside its own kernel is no blocker; 0 = do not ask
};

// Adds a share of a cell at `offset` texels from the receiver, blocked at `height` above the receiver's point.
void vssm_add(inout Blockers found, vec2 offset, vec2 half_cell, float height, float weight)
{
  if (found.extent.x > 0.0 && any(greaterThan(abs(offset) - half_cell, max(found.extent * height, vec2(0.5))))) {
    return;
  }
  found.blocked += weight;
  found.height += weight * height;
}

uvec4 vssm_sum(ivec2 texel)
{
  // A prefix: sums up to, not including, the texel. The table begins at the atlas' corner.
  return (min(texel.x, texel.y) <= 0) ? uvec4(0u) : texelFetch(depth_table, texel - 1, 0);
}

void vssm_texel(inout Blockers found, ShadowReceiver r, vec3 normal, ivec2 texel, float weight)
{
  found.whole += weight;
  if (shadow_blocked(r, vec2(texel), normal)) {
    float q = texelFetch(depth_maps, ivec2(r.rectangle.xy) + texel, 0).x;
    vssm_add(found, vec2(texel) + 0.5 - r.texel, vec2(0.5), max(q - r.q, r.slack), weight);
  }
}

// Texels first..last of the view, whose sum in the table is `sum`.
void vssm_cell(inout Blockers found, ShadowReceiver r, vec3 normal, ivec2 first, ivec2 last, uvec4 sum, float range, float weight)
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
  bool one_sided = bounds.x >= deepest - slack && plane + tilt < range;
  bool lit = bounds.y <= plane - tilt + slack || (mean <= slack && one_sided);
  bool blocked = bounds.x > plane + tilt + slack;
#endif
  vec2 offset = centre - r.texel;
  float base = dot(r.gradient, offset);
  if (blocked) {
    found.whole += weight;
    vssm_add(found, offset, 0.5 * size, max(mean + base, slack), weight);
  }
  else if (lit) {
    found.whole += weight;
  }
  else if (one_sided) {
    // Rounding can leave a square below its least possible value, where all of the cell is blocked evenly.
    square = max(square, mean * mean);
    float share = mean * mean / square;
    found.whole += weight;
    vssm_add(found, offset, 0.5 * size, max(square / mean + base, slack), weight * share);
  }
  else {
    // Something lies far behind the receiver and no bound holds: ask texels.
    for (int k = 0; k < 9; k++) {
      vec2 place = (vec2(float(k % 3), float(k / 3)) + 0.5) / 3.0;
      vssm_texel(found, r, normal, first + ivec2(place * size), weight / 9.0);
    }
  }
}

// Blockers in the box r.texel -+ half_size. `extent` above 0: only those that stand within the kernel of their own
// height; else texels that the box's edge cuts count in part.
Blockers vssm_box(Light light, ShadowReceiver r, vec3 normal, vec2 half_size, vec2 extent)
{
  Blockers found = Blockers(0.0, 0.0, 0.0, extent);
  bool smooth_edges = extent.x <= 0.0;
  ivec2 first;
  ivec2 last;
  kernel_texels(light, r, half_size, first, last);
  vec2 low = max(r.texel - half_size, vec2(first));
  vec2 high = min(r.texel + half_size, vec2(last + 1));
  ivec2 count = last - first + 1;
  if (max(count.x, count.y) <= FEW_TEXELS) {
    for (int y = first.y; y <= last.y; y++) {
      for (int x = first.x; x <= last.x; x++) {
        vec2 covered = min(vec2(x, y) + 1.0, high) - max(vec2(x, y), low);
        vec2 place = (vec2(x, y) + 0.5 - r.texel) / half_size;
        float weight = covered.x * covered.y * kernel_weight(light, place, 1.0 / min(half_size.x, half_size.y));
        vssm_texel(found, r, normal, ivec2(x, y), max(weight, 1e-6));
      }
    }
    return found;
  }
  // Lines of the grid: with smooth edges, the first and the last cell are one texel wide.
  int cells = (max(count.x, count.y) > 4 * CELL_TEXELS) ? 8 : (smooth_edges ? 6 : CELLS);
  int border = smooth_edges ? 1 : 0;
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
        if (weight > 0.0) {
          uvec4 sum = corner - corner_before - below + below_before;
          vssm_cell(found, r, normal, ivec2(left, bottom), ivec2(line_x, line_y) - 1, sum, range, weight);
        }
      }
      row_below[i] = corner;
      corner_before = corner;
      below_before = below;
      left = line_x;
    }
    bottom = line_y;
  }
  return found;
}

float light_visibility(Light light, vec3 position, vec3 normal)
{
  ShadowReceiver r;
  if (!shadow_find(light.first_view, light.view_count, position, normal, r)) {
    return 1.0;
  }
  if (r.rectangle.w <= 0.0) {
    return shadow_blocked(r, min(floor(r.texel), vec2(r.rectangle.z - 1.0)), normal) ? 0.0 : 1.0;
  }
  vec2 extent = kernel_extent(light, r);
  float most = min(0.5 * r.rectangle.z, 4.0 * float(CELL_TEXELS));
  float height = kernel_height(light, r, extent, most);
  if (height <= 0.0) {
    return 1.0 + height;
  }
  Blockers search = vssm_box(light, r, normal, clamp(extent * height, vec2(0.5), vec2(most)), max(extent, vec2(1e-30)));
  if (search.blocked <= 0.0) {
    return 1.0;
  }
  float blocker = min(search.height / search.blocked, height);
  Blockers kernel = vssm_box(light, r, normal, clamp(extent * blocker, vec2(0.5), vec2(most)), vec2(0.0));
  return clamp(1.0 - kernel.blocked / max(kernel.whole, 1e-30), 0.0, 1.0);
}
