// Irradiance at the points that gather for their groups, from their micro-buffers. WAYS: and `out_way`, the mean direction that it
// comes from, times its luminance.
#include "lib/math.glsl"
#if defined(WAYS) || defined(PLACES)
#include "micro/gathering.glsl"
#include "lib/random.glsl"
#endif
#ifdef WAYS
#include "micro/gathering_frame.glsl"
#endif
#define NOTHING 0xffffffffu
#define MICRO_WORD(texel) (micro_fetch(texel).x)

vec4 radiance_texel(uint index)
{
  return node_radiance_fetch(ivec2(int(index & 2047u), int(index >> 11u)));
}

#include "micro/sum.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec3 place = vec3(0.0);
#ifdef WAYS
  MicroFrame f = gathering_frame(pixel.y * NODE_ROW + pixel.x);
  place = f.place;
  out_way = vec4(micro_way(pixel * micro_side, f), 0.0);
#elif defined(PLACES)
  vec3 axis;
  place = leaf_middle(gathering_leaf((pixel.y * NODE_ROW + pixel.x) >> 1), axis);
#endif
  out_arriving = micro_sum(pixel * micro_side, place);
}
