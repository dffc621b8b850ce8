// One level of a pyramid of means from 2x2 entries of the level below (addon/frame/tables.py).
#include "generated/source"

void main()
{
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(texel, extent))) {
    return;
  }
  ivec2 below = 2 * texel + ivec2(0, source_row);
  vec4 sum = means_source(below) + means_source(below + ivec2(1, 0)) + means_source(below + ivec2(0, 1)) +
             means_source(below + ivec2(1, 1));
  imageStore(pyramid, texel + ivec2(0, row), 0.25 * sum);
}
