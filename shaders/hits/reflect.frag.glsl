// What points of surfaces reflect of even light, as a diffuse surface where each of them lies (addon/lighting/lit_points.py).
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "indirect/albedo.glsl"

void main()
{
  out_position = vec4(0.0);
  out_normal = vec4(0.0);
  out_albedo = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = surface_position_fetch(pixel);
  if (position.w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  vec3 albedo = surface_albedo(s, MEAN_COSINE);
  if (!is_finite(albedo.r + albedo.g + albedo.b)) {
    return;
  }
  out_position = position;
  out_normal = surface_normal_fetch(pixel);
  out_albedo = vec4(min(albedo, vec3(1.0)), 0.0);
}
