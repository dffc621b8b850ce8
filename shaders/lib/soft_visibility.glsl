// Visibility of a light with extent, or of the part of it that a map stands for, in two steps: the mean height of the
// blockers in the largest kernel that matters, then the share of blockers in the kernel of that height. The same is asked
// of what stands close to the receiver, by rays (lib/contact.glsl) or of a smaller window, and the darker answer counts:
// each is what the blockers of some height hide at least.
//
// The technique that includes this file last brings `kernel_cells`, which adds what it finds in a box. A texel at the
// offset d in the kernel of height h stands for one point of the light (lib/soft_kernel.glsl). It counts by the cosine
// of the direction to that point, which is linear in it: 1 - g d / h, g the gradient of the receiver's plane; points
// below the horizon count neither as lit nor as blocked.
#include "lib/soft_kernel.glsl"

#define MOST_HALF_SIZE 256.0  // of a kernel, texels
#define FEW_TEXELS 5  // up to this size of a kernel every texel is looked at
#define EDGE_ON 1e-3  // cosine of the direction to the map's point

// Adds the blockers in the box r.texel -+ half_size. found.extent above 0: only those that stand within the kernel of
// their own height; else texels that the box's edge cuts count in part.
Blockers kernel_box(Light light, ShadowReceiver r, vec2 beside, vec2 half_size, Blockers found)
{
  ivec2 first;
  ivec2 last;
  kernel_texels(light, r, half_size, first, last);
  ivec2 count = last - first + 1;
  if (max(count.x, count.y) > FEW_TEXELS) {
    kernel_cells(found, light, r, beside, half_size, first, last);
    return found;
  }
  vec2 low = max(r.texel - half_size, vec2(first));
  vec2 high = min(r.texel + half_size, vec2(last + 1));
  for (int y = first.y; y <= last.y; y++) {
    for (int x = first.x; x <= last.x; x++) {
      vec2 covered = min(vec2(x, y) + 1.0, high) - max(vec2(x, y), low);
      vec2 place = (vec2(x, y) + 0.5 - r.texel) / half_size;
      float weight = covered.x * covered.y * kernel_weight(light, place, 1.0 / min(half_size.x, half_size.y));
      weight *= kernel_cosine(found, place * half_size, vec2(0.5));
      kernel_texel(found, r, beside, ivec2(x, y), r.slack, max(weight, 1e-6));
    }
  }
  return found;
}

// From the map's point of view the receiver shows its back, but a part of the light stands above its horizon: rays to
// that part pass below the receiver's plane as the map sees it. Few pixels are such; a grid of texels is enough.
#define BACK_TEXELS 6
#define LEAST_ABOVE 1.5  // rise of the receiver's plane over the kernel beside a blocker's height; 1: the light is just set

Blockers kernel_back(Light light, ShadowReceiver r, vec2 half_size, Blockers found)
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
    // At the ray's own place, by the caster's plane: the receiver's falls and rises by far more within a texel.
    vec4 caster = depth_maps_fetch(ivec2(r.rectangle.xy + texel));
    float height = caster.x - r.q + dot(caster.yz, r.texel + offset - texel - 0.5);
    float weight = kernel_weight(light, offset / half_size, 2.0 / float(BACK_TEXELS));
    if (found.extent.x <= 0.0) {
      weight *= max(dot(found.horizon, offset) - 1.0, 0.0);
    }
    found.whole += weight;
    bool above = caster.w > 0.0 && height > shadow_slack(r.q, vec2(0.0));
    if (above && height < dot(r.gradient, offset) - r.slack) {
      kernel_add(found, offset, 0.5 * step_size, height, weight);
    }
  }
  return found;
}

// Where the map was drawn from, as the receiver sees it.
vec3 kernel_towards(Light light, vec3 position)
{
  if (LIGHT_IS(light, LIGHT_SUN)) {
    return light.point;
  }
  bool offset = LIGHT_IS(light, LIGHT_POINT) || LIGHT_IS(light, LIGHT_SPHERE);
  return light.point + (offset ? light.centre : vec3(0.0)) - position;
}

float kernel_lit(Blockers hiding)
{
  return (hiding.whole > 0.0) ? clamp(1.0 - hiding.blocked / hiding.whole, 0.0, 1.0) : 1.0;
}

#ifdef CONTACT_RAYS
#include "lib/contact.glsl"
#else
// A blocker much lower than the mean is a small part of the window, and hides all of the light where its own kernel is
// full: a wire that touches another. Such blockers are looked for, texel by texel, in a window that is smaller by NEAR_RATIO.
#define NEAR_RATIO 0.25
#define NEAR_TEXELS 4  // along each side of a window, at most

// Blockers in the box r.texel -+ half_size. One that stands higher than `most_height` hides, with a texel of this box, a
// smaller part of the light.
Blockers kernel_near(Light light, ShadowReceiver r, vec2 beside, vec2 half_size, float most_height, vec2 horizon)
{
  Blockers found = blockers_none(vec2(0.0), horizon);
  ivec2 first;
  ivec2 last;
  kernel_texels(light, r, half_size, first, last);
  vec2 low = max(r.texel - half_size, vec2(first));
  vec2 high = min(r.texel + half_size, vec2(last + 1));
  ivec2 count = min(last - first + 1, ivec2(NEAR_TEXELS));
  vec2 step_size = (high - low) / vec2(count);
  for (int y = 0; y < count.y; y++) {
    for (int x = 0; x < count.x; x++) {
      vec2 offset = low + (vec2(x, y) + 0.5) * step_size - r.texel;
      ivec2 texel = ivec2(clamp(floor(r.texel + offset), vec2(first), vec2(last)));
      float weight = kernel_weight(light, offset / half_size, 2.0 / float(NEAR_TEXELS));
      weight *= kernel_cosine(found, offset, 0.5 * step_size);
      found.whole += weight;
      float height;
      if (kernel_blocked(r, beside, texel, height)) {
        height = max(height, r.slack);
        float part = min(most_height / height, 1.0);
        kernel_add(found, offset, vec2(0.0), height, weight * part * part);
      }
    }
  }
  return found;
}

// Visibility past blockers that stand lower than `height`.
float near_visibility(Light light, ShadowReceiver r, vec2 beside, vec2 slope, vec2 extent, float most, float height)
{
  height *= NEAR_RATIO;
  vec2 window = clamp(extent * height, vec2(0.5), vec2(most));
  ivec2 first;
  ivec2 last;
  kernel_texels(light, r, window, first, last);
  float deepest;
  if (kernel_bounds(r, first, last, deepest).y <= deepest) {
    return 1.0;  // nothing stands above the receiver here
  }
  Blockers search = kernel_near(light, r, beside, window, height, vec2(0.0));
  if (search.blocked <= 0.0) {
    return 1.0;
  }
  float blocker = min(search.height / search.blocked, height);
  vec2 size = clamp(extent * blocker, vec2(0.5), vec2(most));
  // Heights scatter around their mean, hence twice: else a slanted blocker would count in part.
  return kernel_lit(kernel_near(light, r, beside, size, 2.0 * blocker, slope / blocker));
}
#endif

// Share of the light that passes blockers of up to `height` above the receiver; `blocker`: their mean height, 0 without.
// `facing`: cosine of the direction to the map's point.
float kernel_visibility(Light light, ShadowReceiver r, float facing, vec3 normal, vec2 extent, float most, float height,
                        out float blocker)
{
  bool back = facing <= -EDGE_ON;
  // Seen edge-on the receiver is a wall that bounds the kernel; what stands higher than its point blocks.
  bool edge_on = abs(facing) < EDGE_ON;
  vec2 slope = edge_on ? shadow_outward(r, normal) * (-1e3 * height) : r.gradient;
  vec2 beside = shadow_beside(r, normal);
  blocker = 0.0;
  if (back && dot(abs(r.gradient), extent) <= LEAST_ABOVE) {
    // Hardly any of the light stands above the horizon; shading normals may show it all the same.
    return shadow_blocked(r, min(floor(r.texel), vec2(r.rectangle.z - 1.0)), normal) ? 0.0 : 1.0;
  }
  vec2 window = clamp(extent * height, vec2(0.5), vec2(most));
  float lit = 1.0;
  Blockers found = blockers_none(max(extent, vec2(1e-30)), edge_on ? slope / height : vec2(0.0));
  for (int turn = 0; turn < 2; turn++) {  // twice the same code, which compilers would otherwise hold twice
    if (back) {
      found = kernel_back(light, r, window, found);
    }
    else {
      found = kernel_box(light, r, beside, window, found);
    }
    if (turn == 1) {
      lit = kernel_lit(found);
    }
    if (found.blocked <= 0.0) {
      break;
    }
    if (turn == 0) {
      blocker = min(found.height / found.blocked, height);
      window = clamp(extent * blocker, vec2(0.5), vec2(most));
      found = blockers_none(vec2(0.0), slope / blocker);
    }
  }
#ifndef CONTACT_RAYS
  if (!back) {
    lit = min(lit, near_visibility(light, r, beside, slope, extent, most, (blocker > 0.0) ? blocker : height));
  }
#endif
  return lit;
}

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  ShadowReceiver r;
  if (!shadow_find(light.first_view, light.view_count, position, normal, r)) {
    return 1.0;
  }
  if (r.rectangle.w <= 0.0) {
    return shadow_blocked(r, min(floor(r.texel), vec2(r.rectangle.z - 1.0)), normal) ? 0.0 : 1.0;
  }
  vec3 towards = safe_normalize(kernel_towards(light, position));
  float facing = dot(normal, towards);
  if (abs(facing) < EDGE_ON) {
    // Seen along its plane the receiver has a slope without bounds, which would excuse all that stands above it.
    r.gradient = vec2(0.0);
    r.slack = shadow_slack(r.q, r.gradient);
  }
  vec2 extent = kernel_extent(light, r, r.rectangle.w);
  float most = min(0.5 * r.rectangle.z, MOST_HALF_SIZE);
  float height = kernel_height(light, r, extent, most);
  if (height <= 0.0) {
    return 1.0 + height;
  }
  float blocker;
  float lit = kernel_visibility(light, r, facing, normal, extent, most, height, blocker);
#ifdef CONTACT_RAYS
  if (lit > 0.0) {
    lit = contact_visibility(light, r, pixel, position, normal, towards, lit, blocker);
  }
#endif
  return lit;
}
