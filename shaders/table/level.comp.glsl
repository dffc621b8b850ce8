// A further level of a pyramid, from the level before in the same image.
#include "table/reduced.glsl"

void main()
{
  ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
  if (all(lessThan(texel, extent))) {
    imageStore(pyramid, texel + ivec2(0, row), reduced(2 * texel + ivec2(0, source_row)));
  }
}
