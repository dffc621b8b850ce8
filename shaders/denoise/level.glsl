// One level of the edge-avoiding wavelet: 5x5 pixels `stride` apart, of those that show the same surface and differ by
// what their variances explain. Pairs of pixels exchange light: what one gives the other takes, so none is lost, however
// skewed the noise is. Carries the variance of what comes out.
#include "lib/math.glsl"
#include "denoise/alike.glsl"

const float UNSEEN = 0.004;  // a standard error below this share of the light is left as it is
const float EQUAL = 0.01;    // share of the light by which pixels may differ in any case

// Share of a pixel `place` strides away, along one axis.
float binomial(int place)
{
  return (place == 0) ? 6.0 / 16.0 : ((place == 1) ? 4.0 / 16.0 : 1.0 / 16.0);
}

// Whether a pixel's noise is worth an exchange.
bool noisy(vec4 light)
{
  float least = UNSEEN * luminance(light.rgb);
  return light.a > least * least;
}

#ifdef REFLECTIONS
// How much two pixels' lobes show the same: by their means, which may differ by what their own samples do.
float shown_alike(vec4 one, vec4 other)
{
  float n = float(count);
  float bright = luminance(one.rgb) / n;
  float other_bright = luminance(other.rgb) / n;
  float spread = max(one.w / n - bright * bright, 0.0) + max(other.w / n - other_bright * other_bright, 0.0);
  vec3 apart = (one.rgb - other.rgb) / n;
  float allowed = 4.0 * spread / n + 1e-3 * (bright * other_bright + 1e-4);
  return exp(-dot(apart, apart) / allowed);
}
#endif

void run(ivec2 pixel)
{
  ivec2 size = light_in_size();
  vec4 own = light_in_fetch(pixel);
  out_light = own;
  Shown here;
  if (!noisy(own) || !shown_at(pixel, here)) {
    return;
  }
  float bright = luminance(own.rgb);
#ifdef REFLECTIONS
  vec4 shown_here = shown_sum_fetch(pixel);
#endif
  vec3 taken = vec3(0.0);
  float weights = 0.0;
  float variance = 0.0;
  for (int y = -2; y <= 2; y++) {
    for (int x = -2; x <= 2; x++) {
      ivec2 place = pixel + ivec2(x, y) * stride;
      if ((x == 0 && y == 0) || any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, size))) {
        continue;
      }
      vec4 light = light_in_fetch(place);
      Shown there;
      if (!noisy(light) || !shown_at(place, there)) {
        continue;
      }
      float other = luminance(light.rgb);
      float allowed = tolerance * tolerance * sqrt(own.a * light.a) + EQUAL * EQUAL * abs(bright * other);
      float weight = binomial(abs(x)) * binomial(abs(y)) * alike(here, there, max(abs(x), abs(y)) * stride)
                     * exp(-(other - bright) * (other - bright) / max(allowed, 1e-37));
#ifdef REFLECTIONS
      weight *= shown_alike(shown_here, shown_sum_fetch(place));
#endif
      taken += weight * (light.rgb - own.rgb);
      weights += weight;
      variance += weight * weight * light.a;
    }
  }
  out_light = vec4(own.rgb + taken, variance + (1.0 - weights) * (1.0 - weights) * own.a);
}
