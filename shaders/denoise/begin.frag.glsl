// Light without the surface's colour, and the variance of its mean: from what two halves of the samples differ by, a
// single number per pixel, as its mean over 3x3 pixels of the same surface. Variance below 0: nothing to filter.
#include "lib/math.glsl"
#include "denoise/alike.glsl"
#ifdef GRASS
#include "lib/closure.glsl"
#endif

// Sums of light without what is left as it is (APART: lighting/kept_apart.py).
#ifdef APART
#define SUM_NOW(pixel) (sum_now_fetch(pixel).rgb - apart_sum_fetch(pixel).rgb)
#define HALF_SUM(pixel) (half_sum_fetch(pixel).rgb - apart_half_fetch(pixel).rgb)
#else
#define SUM_NOW(pixel) (sum_now_fetch(pixel).rgb)
#define HALF_SUM(pixel) (half_sum_fetch(pixel).rgb)
#endif

vec3 without_color(vec3 light, ivec2 pixel)
{
#if defined(OF_MEDIA) || defined(THROUGH_GLASS)
  return light;
#else
  return light / max(color_sum_fetch(pixel).rgb / float(count), vec3(LEAST_COLOR));
#endif
}

float half_difference(ivec2 pixel, vec3 whole)
{
  vec3 first = HALF_SUM(pixel);
  float n = float(count);
  float m = float(half_count);
  float difference = luminance(without_color(first / m - (whole - first) / (n - m), pixel));
  return difference * difference * (m * (n - m) / (n * n));
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 size = sum_now_size();
  vec3 whole = SUM_NOW(pixel);
  out_light = vec4(without_color(whole / float(count), pixel), -1.0);
#ifdef GRASS
  if (int(floor(surface_lobe_fetch(pixel).z / 2097152.0)) == SURFACE_GRASS) {
    return;  // its blades are no noise
  }
#endif
  Shown here;
#if defined(OF_MEDIA) || defined(THROUGH_GLASS)
  bool colored = true;
#else
  bool colored = max_component(color_sum_fetch(pixel).rgb) > LEAST_COLOR * float(count);
#endif
  if (!shown_at(pixel, here) || !colored) {
    return;
  }
  float sum = 0.0;
  float weights = 0.0;
  for (int y = -1; y <= 1; y++) {
    for (int x = -1; x <= 1; x++) {
      ivec2 place = clamp(pixel + ivec2(x, y), ivec2(0), size - 1);
      Shown there;
      if (shown_at(place, there)) {
        float weight = alike(here, there, 1);
        sum += weight * half_difference(place, SUM_NOW(place));
        weights += weight;
      }
    }
  }
  out_light.a = sum / max(weights, 1e-30);
}
