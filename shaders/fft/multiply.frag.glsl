// The transforms of four real images, as two complex ones, times those of four others (addon/kernels/fft.py).
#include "fft/pairs.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  ivec2 extent = field_size();
  ivec2 mirrored = (extent - texel) % extent;
  vec4 here = field_fetch(texel);
  vec4 opposite = field_fetch(mirrored);
  vec4 factor = factors_fetch(texel);
  vec4 opposite_factor = factors_fetch(mirrored);
  out_field = vec4(pair_product(here.xy, opposite.xy, factor.xy, opposite_factor.xy),
                   pair_product(here.zw, opposite.zw, factor.zw, opposite_factor.zw));
}
