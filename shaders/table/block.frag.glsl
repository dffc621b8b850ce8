// Blocks of BLOCK x BLOCK texels taken together: the sum of rgb, the largest alpha (addon/kernels/reduction.py).
#include "generated/source"

void main()
{
  ivec2 first = BLOCK * ivec2(gl_FragCoord.xy);
  vec3 sum = vec3(0.0);
  float most = 0.0;
  for (int j = 0; j < BLOCK; j++) {
    vec3 row = vec3(0.0);
    for (int i = 0; i < BLOCK; i++) {
      ivec2 texel = first + ivec2(i, j);
      if (all(lessThan(texel, extent))) {
        vec4 value = reduction_source(texel);
        row += value.rgb;
        most = max(most, value.a);
      }
    }
    sum += row;
  }
  out_value = vec4(sum, most);
}
