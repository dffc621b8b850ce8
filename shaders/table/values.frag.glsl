// What is summed, texel by texel (addon/kernels/tables.py).
#include "generated/source"

void main()
{
  out_value = table_source(ivec2(gl_FragCoord.xy));
}
