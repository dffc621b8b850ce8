// The texels of a depth map that hide a light with extent from a receiver, and bounds of what they hold.
#include "lib/kernel_extent.glsl"

#ifndef TABLE_BLOCK
#define TABLE_BLOCK 1  // texels along each side of what a table has one entry for
#endif

// Share of a cell of the kernel that belongs to the light's shape. `place`: of the cell's centre, in half extents.
float kernel_weight(Light light, vec2 place, float cell)
{
  return LIGHT_IS(light, LIGHT_RECTANGLE) ? 1.0 : clamp((1.0 - length(place)) / cell + 0.5, 0.0, 1.0);
}

// Bounds of q over the texels first..last (from the view's corner, inclusive): those of the up to 3 x 3 blocks of the
// pyramid, of at least 2 x 2 texels, that contain them; 0 where nothing was drawn. `deepest`: least q of the receiver's
// plane within those blocks.
vec2 kernel_bounds(ShadowReceiver r, ivec2 first, ivec2 last, out float deepest)
{
  int span = max(last.x - first.x, last.y - first.y);
  int level = max(int(ceil(log2(float(max(span, 1))))) - 1, 1);
  ivec2 origin = ivec2(r.rectangle.xy);
  ivec2 low = (origin + first) >> level;
  ivec2 high = (origin + last) >> level;
  vec2 near_corner = vec2((low << level) - origin) - r.texel;
  vec2 far_corner = vec2(((high + 1) << level) - origin) - r.texel;
  deepest = r.q + dot(min(r.gradient * near_corner, r.gradient * far_corner), vec2(1.0));
  ivec2 rows = ivec2(0, bounds_rows - (bounds_rows >> (level - 1)));
  vec2 bounds = vec2(1e30, -1e30);
  for (int k = 0; k < 9; k++) {  // a loop of few turns whose number is not known took longer than the fetches it saved
    vec2 entry = depth_bounds_fetch(min(low + ivec2(k % 3, k / 3), high) + rows).xy;
    bounds = vec2(min(bounds.x, entry.x), max(bounds.y, entry.y));
  }
  return bounds;
}

// Texels of the view (first..last) that can hold blockers: in front of an area light's plane, in whole blocks of a
// table. Views beside its axis have that plane's horizon along a row or a column (turn_along in addon/lighting/depth_maps.py).
void kernel_limits(Light light, ShadowReceiver r, out vec2 first, out vec2 last)
{
  first = vec2(0.0);
  last = vec2(r.rectangle.z - 1.0);
  if (!LIGHT_IS(light, LIGHT_RECTANGLE) && !LIGHT_IS(light, LIGHT_ELLIPSE)) {
    return;
  }
  vec3 forward = sources.view[r.view * VIEW_TEXELS + 2].xyz;
  if (abs(dot(forward, light.axis)) > 0.01) {
    return;
  }
  vec3 across = sources.view[r.view * VIEW_TEXELS].xyz;
  vec3 along = sources.view[r.view * VIEW_TEXELS + 1].xyz;
  vec2 rise = vec2(dot(across, light.axis), dot(along, light.axis));
  vec2 horizon = (vec2(dot(across, forward), dot(along, forward)) * 0.5 + 0.5) * r.rectangle.z;
  int k = (abs(rise.x) > abs(rise.y)) ? 0 : 1;
  float block = float(TABLE_BLOCK);
  float here = clamp(horizon[k], 0.0, r.rectangle.z);
  if (rise[k] > 0.0) {
    first[k] = min(block * ceil(here / block), r.rectangle.z - block);
  }
  else {
    last[k] = max(block * floor(here / block), block) - 1.0;
  }
}

// Texels that the box centre -+ half_size touches, cut off at the view's edges and at the light's plane.
void kernel_texels(Light light, ShadowReceiver r, vec2 half_size, out ivec2 first, out ivec2 last)
{
  vec2 low;
  vec2 high;
  kernel_limits(light, r, low, high);
  first = ivec2(clamp(floor(r.texel - half_size), low, high));
  last = ivec2(clamp(ceil(r.texel + half_size) - 1.0, low, high));
}

#define KERNEL_SEARCHES 2

// How high above the receiver (in q) blockers can stand that the kernel reaches: 0 = lit, below 0 = all of the kernel
// is blocked whatever its size.
//
// The kernel of the highest caster in the map contains every blocker; the highest caster within that kernel gives a
// smaller one, and so on.
float kernel_height(Light light, ShadowReceiver r, vec2 extent, float most_size)
{
  float size = r.rectangle.z;
  ivec2 first = ivec2(0);
  ivec2 last = ivec2(size - 1.0);
  float deepest;
  vec2 bounds = kernel_bounds(r, first, last, deepest);
  float height = bounds.y - r.q;
  float least = shadow_slack(r.q, vec2(0.0));  // its slope excuses nothing that stands above a receiver seen edge-on
  for (int k = 0; k < KERNEL_SEARCHES; k++) {
    if (height <= least) {
      return 0.0;
    }
    vec2 half_size = clamp(extent * height, vec2(0.5), vec2(most_size));
    kernel_texels(light, r, half_size, first, last);
    bounds = kernel_bounds(r, first, last, deepest);
    float tilt = dot(abs(r.gradient), half_size + 1.0);
    if (bounds.x > r.q + tilt + r.slack) {
      return -1.0;
    }
    height = min(height, bounds.y - r.q);
  }
  return (height <= least) ? 0.0 : height;
}

// What was found in a kernel or in the window where blockers are looked for.
struct Blockers {
  float whole;
  float blocked;
  float height;  // above the receiver's point, summed over what is blocked
  vec2 extent;  // of the kernel per unit of height: what stands outside its own kernel is no blocker; 0 = do not ask
  vec2 horizon;  // fall of the cosine per texel, relative to the light's middle; 0 = the same for all of the kernel
};

Blockers blockers_none(vec2 extent, vec2 horizon)
{
  Blockers none;
  none.whole = 0.0;
  none.blocked = 0.0;
  none.height = 0.0;
  none.extent = extent;
  none.horizon = horizon;
  return none;
}

// Adds a share of a cell at `offset` texels from the receiver, blocked at `height` above the receiver's point. What
// stands above a steep receiver's plane but not above its point lies beside all rays to the light.
void kernel_add(inout Blockers found, vec2 offset, vec2 half_cell, float height, float weight)
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

// Whether the caster in a texel of the view hides the map's point, as shadow_blocked, and its height above the receiver's
// point. `beside`: by shadow_beside, which is the same for all texels.
bool kernel_blocked(ShadowReceiver r, vec2 beside, ivec2 texel, out float height)
{
  vec4 caster = depth_maps_fetch(ivec2(r.rectangle.xy) + texel);
  vec2 behind = shadow_behind(r, caster, r.texel - vec2(texel) - 0.5);
  behind = shadow_unsure(r, caster, behind) ? beside : behind;
  height = caster.x - r.q;
  return min(behind.x, behind.y) > 0.0;
}

// `least`: height that a blocker has at least; a kernel of few texels sees tilted casters beside their texels' centres.
void kernel_texel(inout Blockers found, ShadowReceiver r, vec2 beside, ivec2 texel, float least, float weight)
{
  found.whole += weight;
  float height;
  if (kernel_blocked(r, beside, texel, height)) {
    kernel_add(found, vec2(texel) + 0.5 - r.texel, vec2(0.5), max(height, least), weight);
  }
}

// Mean cosine, relative to that of the light's middle, over a part of the kernel.
float kernel_cosine(Blockers found, vec2 offset, vec2 half_part)
{
  float cosine = 1.0 - dot(found.horizon, offset);
  float reach = dot(abs(found.horizon), half_part);
  if (abs(cosine) < reach) {
    return (cosine + reach) * (cosine + reach) / (4.0 * reach);  // what lies below the horizon cut off
  }
  return max(cosine, 0.0);
}
