// Sums of chunks of CHUNK texels along STEP (addon/frame/tables.py).
#include "generated/source"

void main()
{
  ivec2 chunk = ivec2(gl_GlobalInvocationID.xy);
  ivec2 first = chunk * CHUNK_EXTENT;
  if (any(greaterThanEqual(first, extent))) {
    return;
  }
  TABLE_VALUE sum = TABLE_VALUE(0);
  for (int k = 0; k < CHUNK; k++) {
    ivec2 texel = first + k * STEP;
    if (all(lessThan(texel, extent))) {
      sum += table_source(texel);
    }
  }
  imageStore(chunk_out, chunk, sum);
}
