// Irradiance at the points that gather for their groups, from their micro-buffers.
#include "lib/math.glsl"
#define NOTHING 0xffffffffu
#define MICRO_WORD(texel) (micro_fetch(texel).x)

vec4 radiance_texel(uint index)
{
  return node_radiance_fetch(ivec2(int(index & 2047u), int(index >> 11u)));
}

#include "micro/sum.glsl"

void main()
{
  out_arriving = micro_sum(ivec2(gl_FragCoord.xy) * micro_side);
}
