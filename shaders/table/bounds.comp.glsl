// One level of a min-max pyramid from 2x2 entries of the level below (addon/frame/tables.py).
#include "generated/source"

void main()
{
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(texel, extent))) {
    return;
  }
  ivec2 below = 2 * texel + ivec2(0, source_row);
  vec2 a = bounds_source(below);
  vec2 b = bounds_source(below + ivec2(1, 0));
  vec2 c = bounds_source(below + ivec2(0, 1));
  vec2 d = bounds_source(below + ivec2(1, 1));
  vec2 least = min(min(a, b), min(c, d));
  vec2 most = max(max(a, b), max(c, d));
  imageStore(pyramid, texel + ivec2(0, row), vec4(least.x, most.y, 0.0, 0.0));
}
