// Running sums along STEP: what the chunks before this one hold, then texel by texel (addon/frame/tables.py).
#include "generated/source"

void main()
{
  ivec2 chunk = ivec2(gl_GlobalInvocationID.xy);
  ivec2 first = chunk * CHUNK_EXTENT;
  if (any(greaterThanEqual(first, extent))) {
    return;
  }
  TABLE_VALUE sum = TABLE_VALUE(0);
  for (ivec2 before = chunk - STEP; min(before.x, before.y) >= 0; before -= STEP) {
    sum += texelFetch(chunk_sums, before, 0);
  }
  for (int k = 0; k < CHUNK; k++) {
    ivec2 texel = first + k * STEP;
    if (all(lessThan(texel, extent))) {
      sum += table_source(texel);
      imageStore(table_out, texel, sum);
    }
  }
}
