// Visibility of a light with extent from one depth map: convolution soft shadow mapping (addon/techniques/cssm.py).
//
// Both steps, blocker search and penumbra, are filtered depth comparisons. The kernel is cut into CELLS x CELLS boxes,
// each compared at the highest point of the receiver's plane within it, so that a tilted receiver does not shadow itself.
#include "lib/soft_kernel.glsl"
#include "cssm/filter.glsl"
#include "cssm/range.glsl"

void kernel_cells(inout Blockers found, Light light, ShadowReceiver r, vec2 beside, vec2 half_size, ivec2 first, ivec2 last)
{
  bool search = found.extent.x > 0.0;
  vec2 low = max(r.texel - half_size, vec2(first));
  vec2 size = (min(r.texel + half_size, vec2(last + 1)) - low) / float(CELLS);
  bool perspective;
  vec2 range = cssm_range(ivec2(r.rectangle.xy), perspective);
  float tilt = 0.5 * dot(abs(r.gradient), size);
  for (int k = 0; k < CELLS * CELLS; k++) {
    vec2 a = low + size * vec2(float(k % CELLS), float(k / CELLS));
    vec2 b = a + size;
    vec2 offset = 0.5 * (a + b) - r.texel;
    float weight = kernel_weight(light, offset / half_size, 2.0 / float(CELLS)) * kernel_cosine(found, offset, 0.5 * size);
    if (weight <= 0.0) {
      continue;
    }
    found.whole += weight;
    // Only what is nearer to the light than the receiver's point blocks, however low the plane is here.
    float d = basis_depth(max(r.q + dot(r.gradient, offset) + tilt, r.q), range, perspective);
    if (search) {
      vec2 blockers = basis_blockers(r.rectangle, a, b, d - SEARCH_OFFSET);
      if (blockers.x > LEAST_SHARE) {
        float height = basis_q(min(blockers.y / blockers.x, d), range, perspective) - r.q;
        kernel_add(found, offset, 0.5 * size, max(height, r.slack), weight * min(blockers.x, 1.0));
      }
    }
    else {
      float share = basis_nearer(r.rectangle, a, b, d - SERIES_OFFSET);
      found.blocked += weight * share;
    }
  }
}

#include "lib/soft_visibility.glsl"
