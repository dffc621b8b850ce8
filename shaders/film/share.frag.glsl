// Light of a tile: mean square and mean of its luminance (addon/frame/shares.py).
#include "lib/math.glsl"

void main()
{
  ivec2 first = TILE * ivec2(gl_FragCoord.xy);
  vec2 sum = vec2(0.0);
  int count = 0;
  for (int j = 0; j < TILE; j++) {
    for (int i = 0; i < TILE; i++) {
      ivec2 texel = first + ivec2(i, j);
      if (all(lessThan(texel, extent))) {
        float light = luminance(abs(LIGHT_OF_ALL));
        light = is_finite(light) ? min(light, 1e9) : 0.0;
        sum += vec2(light * light, light);
        count++;
      }
    }
  }
  out_share = vec4(sum / float(max(count, 1)), 0.0, 0.0);
}
