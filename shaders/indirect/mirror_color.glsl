// What smooth mirrors reflect, by the means of their materials (`reflectance`, see indirect/reflectance.frag.glsl).
#include "indirect/bands.glsl"

// What of the lobe that stands there is the mirror's own. That one is at least LEAST_ALPHA wide, and scaled up for the light
// that so rough a lobe scatters more than once: of white metal by a sixth. The mean albedo has the lobe's own width.
vec3 mirror_scale(int material)
{
  ivec2 place = ivec2(material & 15, material >> 4);
  int rows = reflectance_rows();
  vec3 mirrored = max(reflectance_fetch(place).rgb - reflectance_fetch(place + ivec2(0, rows)).rgb, vec3(0.0));
  vec3 straight = reflectance_fetch(place + ivec2(0, 2 * rows)).rgb;
  vec3 grazing = reflectance_fetch(place + ivec2(0, 3 * rows)).rgb;
  // The means are of this view.
  float rise = pow(1.0 - 0.577, 5.0);
  return clamp(mirrored / max(mix(straight, grazing, rise), vec3(1e-6)), vec3(0.0), vec3(1.0));
}

vec3 mirror_color(int material, float cosine)
{
  ivec2 place = ivec2(material & 15, material >> 4);
  int rows = reflectance_rows();
  vec3 straight = reflectance_fetch(place + ivec2(0, 2 * rows)).rgb;
  vec3 grazing = reflectance_fetch(place + ivec2(0, 3 * rows)).rgb;
  return mirror_scale(material) * mix(straight, grazing, pow(clamp(1.0 - cosine, 0.0, 1.0), 5.0));
}
