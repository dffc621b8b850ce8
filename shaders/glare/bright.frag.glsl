// What scatters, means of FACTOR x FACTOR pixels, in the corner of a larger image of zeros.
#include "glare/excess.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  ivec2 extent = picture_size();
  vec3 sum = vec3(0.0);
  for (int j = 0; j < FACTOR; j++) {
    for (int i = 0; i < FACTOR; i++) {
      ivec2 pixel = FACTOR * texel + ivec2(i, j);
      if (all(lessThan(pixel, extent))) {
        sum += excess_of(picture_fetch(pixel).rgb, white, most_light);
      }
    }
  }
  out_light = vec4(sum / float(FACTOR * FACTOR), 0.0);
}
