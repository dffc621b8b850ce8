// Visibility of a light with extent from one depth map: variance soft shadow mapping (addon/techniques/vssm.py).
//
// Whether something blocks is told by its height above the receiver's plane, in q, positive towards the light: no
// surface shadows itself. Which points of the light it hides follows from its height above the receiver's point. In a
// cell that holds only the receiver and blockers of one height h, a share f of them, mean f h and mean square f h^2
// give both:
//     f = mean^2 / square,   h = square / mean.
// This is Chebyshev's bound and the closed-form blocker depth of the source, written relative to the receiver.
//
// A texel at the offset d in the kernel of height h stands for one point of the light (lib/soft_kernel.glsl). It counts
// by the cosine of the direction to that point, which is linear in it: 1 - g d / h, g the gradient of the receiver's
// plane; points below the horizon count neither as lit nor as blocked.
#include "lib/soft_kernel.glsl"
#include "vssm/range.glsl"

#define CELL_LINES 9  // of a grid of up to 8 x 8 cells
#define CELL_TEXELS 64  // widest cell whose sums fit into 32 bits
#define EDGE_ON 1e-3  // cosine of the direction to the map's point
#define FEW_TEXELS 5  // up to this size of a kernel every texel is looked at

struct Blockers {
  float whole;
  float blocked;
  float height;  // above the receiver's point, summed over what is blocked
  vec2 extent;  // of the kernel per unit of height: what stands outside its own kernel is no blocker; 0 = do not ask
  vec2 horizon;  // fall of the cosine per texel, relative to the light's middle; 0 = the same for all of the kernel
};

// Adds a share of a cell at `offset` texels from the receiver, blocked at `height` above the receiver's point. What
// stands above a steep receiver's plane but not above its point lies beside all rays to the light.
void vssm_add(inout Blockers found, vec2 offset, vec2 half_cell, float height, float weight)
{
  if (height <= 0.0) {
    return;
  }
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

// `least`: height that a blocker has at least; a kernel of few texels sees tilted casters beside their texels' centres.
void vssm_texel(inout Blockers found, ShadowReceiver r, vec3 normal, ivec2 texel, float least, float weight)
{
  found.whole += weight;
  if (shadow_blocked(r, vec2(texel), normal)) {
    float q = texelFetch(depth_maps, ivec2(r.rectangle.xy) + texel, 0).x;
    vssm_add(found, vec2(texel) + 0.5 - r.texel, vec2(0.5), max(q - r.q, least), weight);
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
  bool clear = bounds.x > plane + tilt + slack;  // of the receiver's plane
  bool blocked = clear && bounds.x > r.q + slack;
  lit = lit || (clear && bounds.y <= r.q + slack);
  one_sided = one_sided && !clear;
#endif
  vec2 offset = centre - r.texel;
  float base = dot(r.gradient, offset);
  if (blocked) {
    found.whole += weight;
    vssm_add(found, offset, 0.5 * size, mean + base, weight);
  }
  else if (lit) {
    found.whole += weight;
  }
  else if (one_sided) {
    // Rounding can leave a square below its least possible value, where all of the cell is blocked evenly.
    square = max(square, mean * mean);
    float share = mean * mean / square;
    found.whole += weight;
    vssm_add(found, offset, 0.5 * size, square / mean + base, weight * share);
  }
  else {
    // Something lies far behind the receiver and no bound holds: ask texels.
    for (int k = 0; k < 9; k++) {
      vec2 place = (vec2(float(k % 3), float(k / 3)) + 0.5) / 3.0;
      vssm_texel(found, r, normal, first + ivec2(place * size), 0.0, weight / 9.0);
    }
  }
}

// Mean cosine, relative to that of the light's middle, over a part of the kernel.
float vssm_cosine(Blockers found, vec2 offset, vec2 half_part)
{
  float cosine = 1.0 - dot(found.horizon, offset);
  float reach = dot(abs(found.horizon), half_part);
  if (abs(cosine) < reach) {
    return (cosine + reach) * (cosine + reach) / (4.0 * reach);  // what lies below the horizon cut off
  }
  return max(cosine, 0.0);
}

// Blockers in the box r.texel -+ half_size. `extent` above 0: only those that stand within the kernel of their own
// height; else texels that the box's edge cuts count in part. `horizon`: see Blockers.
Blockers vssm_box(Light light, ShadowReceiver r, vec3 normal, vec2 half_size, vec2 extent, vec2 horizon)
{
  Blockers found = Blockers(0.0, 0.0, 0.0, extent, horizon);
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
        weight *= vssm_cosine(found, place * half_size, vec2(0.5));
        vssm_texel(found, r, normal, ivec2(x, y), r.slack, max(weight, 1e-6));
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
        weight *= vssm_cosine(found, place * half_size, 0.5 * (b - a));
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

// From the map's point of view the receiver shows its back, but a part of the light stands above its horizon: rays to
// that part pass below the receiver's plane as the map sees it. Few pixels are such; a grid of texels is enough.
#define BACK_TEXELS 6

Blockers vssm_back(Light light, ShadowReceiver r, vec2 half_size, Blockers found)
{
  ivec2 first;
  ivec2 last;
  kernel_texels(light, r, half_size, first, last);
  vec2 low = max(r.texel - half_size, vec2(first));
  vec2 high = min(r.texel + half_size, vec2(last + 1));
  vec2 step_size = (high - low) / float(BACK_TEXELS);
  for (int k = 0; k < BACK_TEXELS * BACK_TEXELS; k++) {
    vec2 offset = low + (vec2(float(k % BACK_TEXELS), float(k / BACK_TEXELS)) + 0.5) * step_size - r.texel;
    vec2 texel = clamp(floor(r.texel + offset), vec2(first), vec2(last));
    float height = kernel_entry(ivec2(r.rectangle.xy + texel), 0).y - r.q;
    float weight = kernel_weight(light, offset / half_size, 2.0 / float(BACK_TEXELS));
    if (found.extent.x <= 0.0) {
      weight *= max(dot(found.horizon, offset) - 1.0, 0.0);
    }
    found.whole += weight;
    if (height > r.slack && height < dot(r.gradient, texel + 0.5 - r.texel) - r.slack) {
      vssm_add(found, offset, 0.5 * step_size, height, weight);
    }
  }
  return found;
}

// Where the map was drawn from, as the receiver sees it.
vec3 vssm_towards(Light light, vec3 position)
{
  if (light.kind == LIGHT_SUN) {
    return light.point;
  }
  bool offset = light.kind == LIGHT_POINT || light.kind == LIGHT_SPHERE;
  return light.point + (offset ? light.centre : vec3(0.0)) - position;
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
  vec3 towards = safe_normalize(vssm_towards(light, position));
  bool back = dot(normal, towards) < 0.0;
  if (abs(dot(normal, towards)) < EDGE_ON) {
    // Seen along its plane the receiver has no gradient: it is a wall that bounds the kernel.
    back = false;
    r.gradient = shadow_outward(r, normal) * (-1e3 * height);
  }
  vec2 within = max(extent, vec2(1e-30));
  vec2 window = clamp(extent * height, vec2(0.5), vec2(most));
  Blockers search;
  if (back) {
    search = vssm_back(light, r, window, Blockers(0.0, 0.0, 0.0, within, vec2(0.0)));
  }
  else {
    search = vssm_box(light, r, normal, window, within, vec2(0.0));
  }
  if (search.blocked <= 0.0) {
    return 1.0;
  }
  float blocker = min(search.height / search.blocked, height);
  vec2 horizon = r.gradient / blocker;
  vec2 size = clamp(extent * blocker, vec2(0.5), vec2(most));
  Blockers kernel;
  if (back) {
    kernel = vssm_back(light, r, size, Blockers(0.0, 0.0, 0.0, vec2(0.0), horizon));
  }
  else {
    kernel = vssm_box(light, r, normal, size, vec2(0.0), horizon);
  }
  return (kernel.whole > 0.0) ? clamp(1.0 - kernel.blocked / kernel.whole, 0.0, 1.0) : 1.0;
}
