// One level of the edge-avoiding wavelet: 5x5 pixels `stride` apart, of those that show the same surface and differ by
// what their variances explain. Carries the variance of what comes out.
#include "denoise/alike.glsl"
#include "lib/math.glsl"

const float BINOMIAL[3] = float[3](6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0);
const float UNSEEN = 0.004;   // a standard error below this share of the light is left as it is
const float EQUAL = 0.01;     // shares of the light by which pixels may differ in any case

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 size = textureSize(light_in, 0);
  vec4 own = texelFetch(light_in, pixel, 0);
  out_light = own;
  float bright = luminance(own.rgb);
  Shown here;
  if (own.a <= UNSEEN * UNSEEN * bright * bright || !shown_at(pixel, here)) {
    return;
  }
  float pixel_size = pixel_size_at(here.position);
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  float variance = 0.0;
  for (int y = -2; y <= 2; y++) {
    for (int x = -2; x <= 2; x++) {
      ivec2 place = pixel + ivec2(x, y) * stride;
      if (any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, size))) {
        continue;
      }
      vec4 light = texelFetch(light_in, place, 0);
      Shown there;
      if (light.a < 0.0 || !shown_at(place, there)) {
        continue;
      }
      float difference = luminance(light.rgb) - bright;
      float allowed = 0.5 * tolerance * tolerance * (own.a + light.a) + EQUAL * EQUAL * bright * bright;
      float weight = BINOMIAL[abs(x)] * BINOMIAL[abs(y)] * alike(here, there, pixel_size, max(abs(x), abs(y)) * stride)
                     * exp(-difference * difference / max(allowed, 1e-37));
      sum += weight * light.rgb;
      weights += weight;
      variance += weight * weight * light.a;
    }
  }
  out_light = (weights > 0.0) ? vec4(sum / weights, variance / (weights * weights)) : own;
}
