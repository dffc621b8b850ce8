// The first level of a pyramid, from its source.
#include "table/reduced.glsl"

void main()
{
  out_entry = reduced(2 * ivec2(gl_FragCoord.xy));
}
