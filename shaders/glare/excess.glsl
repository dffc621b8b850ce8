// What of a pixel scatters visibly: what its brightest channel exceeds white by, in its own colour.
#include "lib/math.glsl"

vec3 finite_light(vec3 light)
{
  vec3 kept = vec3(is_finite(light.r) ? light.r : 0.0, is_finite(light.g) ? light.g : 0.0,
                   is_finite(light.b) ? light.b : 0.0);
  return kept;
}

vec3 excess_of(vec3 light, float threshold, float limit)
{
  vec3 kept = clamp(finite_light(light), vec3(0.0), vec3(limit));
  float peak = max_component(kept);
  return (peak > threshold) ? kept * ((peak - threshold) / peak) : vec3(0.0);
}
