// Irradiance of the unoccluded world by normal (addon/sources/irradiance.py), and how open each pixel was to it so far.
//
// Shared directions draw the world's light U = sum of L cos / p together with its shadows, sum of L cos V / p. U has a
// known mean, E(n), so U - E(n) is noise without a mean that goes with the noise of the light that arrives (a control
// variate). `openness` of it is taken off: the share of U that arrived in the samples before, of which this sample's
// draws know nothing, so that the mean stays. Only the first sample takes its own share.
#include "lib/math.glsl"

vec3 known_irradiance(vec3 normal)
{
  int columns = irradiance_table_size().x;
  int rows = irradiance_table_size().y - 2;
  float azimuth = (normal.x == 0.0 && normal.y == 0.0) ? 0.0 : atan(normal.y, normal.x);
  vec2 place = vec2((azimuth / (2.0 * PI) + 0.5) * float(columns),
                    (asin(clamp(normal.z, -1.0, 1.0)) / PI + 0.5) * float(rows));
  vec2 corner = floor(place);
  corner.y = clamp(corner.y, 0.0, float(rows - 1));
  vec2 t = place - corner;
  int x0 = int(corner.x) % columns;
  int x1 = (int(corner.x) + 1) % columns;
  int y = int(corner.y);
  vec3 low = mix(irradiance_table_fetch(ivec2(x0, y)).rgb, irradiance_table_fetch(ivec2(x1, y)).rgb, t.x);
  vec3 high = mix(irradiance_table_fetch(ivec2(x0, y + 1)).rgb, irradiance_table_fetch(ivec2(x1, y + 1)).rgb, t.x);
  vec3 sum = mix(low, high, t.y);
  for (int k = 0; k < bright_count; k++) {
    vec3 direction = irradiance_table_fetch(ivec2(2 * k, rows + 1)).xyz;
    sum += irradiance_table_fetch(ivec2(2 * k + 1, rows + 1)).rgb * max(dot(normal, direction), 0.0);
  }
  return sum;
}

// Share of the world's light that arrives at a pixel: `arrived` of `drawn` in this sample.
float openness_of(ivec2 pixel, float arrived, float drawn)
{
  vec2 before = openness_fetch(pixel).xy;
  vec2 sums = (before.y > 0.0) ? before : vec2(arrived, drawn);
  return (sums.y > 0.0) ? clamp(sums.x / sums.y, 0.0, 2.0) : 0.0;
}
