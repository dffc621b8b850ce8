// Irradiance by media that is known at every `stride`-th pixel, brought to all pixels: the mean over 5 x 5 of the known ones
// around that are as far away and face alike, times each pixel's own colour. Lobes that no rays follow reflect it as if it
// came evenly from all sides.
#include "lib/math.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "ask/view.glsl"
#include "indirect/albedo.glsl"
#include "media/wide_lobe.glsl"

#define REACH 2.5

float tent(float place, float middle)
{
  return max(1.0 - abs(place - middle) / REACH, 0.0);
}

void main()
{
  out_indirect = vec4(0.0);
  out_glossy = vec4(0.0);
#ifdef SHINING
  out_direct = vec4(0.0);
#endif
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  Surface s = SURFACE_READ(pixel);
  vec4 seen = surface_position_fetch(pixel);
  bool wide = has_wide_lobe(s, shaded_roughness);
  if (seen.w == 0.0 || !(wide || max_component(s.diffuse) > 0.0)) {
    return;
  }
  ivec2 size = known_light_size();
  ivec2 last = surface_position_size() - 1;
  vec2 middle = (vec2(pixel) - vec2(shown_pixel)) / float(stride);
  ivec2 corner = ivec2(floor(middle + 0.5));
  float own = max(distance(s.position, film_view.eye.xyz), 1e-20);
  vec3 found = vec3(0.0);
  vec3 straight = vec3(0.0);
  float total = 0.0;
  int around = (stride > 1) ? 2 : 0;
  for (int y = -around; y <= around; y++) {
    for (int x = -around; x <= around; x++) {
      ivec2 known = corner + ivec2(x, y);
      ivec2 texel = clamp(known, ivec2(0), size - 1);
      vec4 light = known_light_fetch(texel);
      if (light.w < 0.0 || known != texel) {
        continue;
      }
      Surface there = SURFACE_READ(min(texel * stride + shown_pixel, last));
      float off = abs(dot(there.position - s.position, s.geometric_normal)) / own;
      float turned = max(dot(there.normal, s.normal), 0.0);
      float weight = max(1.0 - 8.0 * off, 0.0) * turned * turned * turned * turned + 1e-4;
      weight *= tent(float(known.x), middle.x) * tent(float(known.y), middle.y);
      found += weight * light.rgb;
#ifdef SHINING
      straight += weight * known_straight_fetch(texel).rgb;
#endif
      total += weight;
    }
  }
  found /= max(total, 1e-30);
  straight /= max(total, 1e-30);
  vec3 lobe = vec3(0.0);
  if (wide) {
    float mu = max(dot(s.normal, view_toward(s.position)), 0.0);
    lobe = surface_albedo(s, mu) - rough_albedo(s.diffuse, s.diffuse_weight, s.diffuse_roughness);
  }
  bool soft = s.kind > LOBE_REFRACTION;
  vec3 diffuse = s.diffuse + (soft ? lobe : vec3(0.0));
  out_indirect = vec4(found * diffuse, 0.0);
  out_glossy = vec4(soft ? vec3(0.0) : (found + straight) * lobe, 0.0);
#ifdef SHINING
  out_direct = vec4(straight * diffuse, 0.0);
#endif
}
