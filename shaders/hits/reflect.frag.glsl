// What points of surfaces reflect of even light, as a diffuse surface where each of them lies (addon/lighting/lit_points.py).
// GLOSS: out_diffuse is without what lobes of microfacets reflect; out_gloss is that, and their roughness, below 0 of smooth lobes
// of materials that throw caustics as mirrors (`thrown_materials`).
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "indirect/albedo.glsl"

void main()
{
  out_position = vec4(0.0);
  out_normal = vec4(0.0);
  out_albedo = vec4(0.0);
#ifdef GLOSS
  out_diffuse = vec4(0.0);
  out_gloss = vec4(0.0);
#endif
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
#ifdef GLOSS
  out_diffuse = out_albedo;
  if (s.kind < LOBE_REFRACTION) {
    int material = int(hit_material_fetch(pixel).r + 0.5);
    bool mirror = thrown_materials_fetch(ivec2(material & 255, material >> 8)).r > 0.5 && s.glossy_roughness <= SMOOTH_MIRROR;
    s.glossy_weight = vec3(0.0);
    out_diffuse = vec4(min(surface_albedo(s, MEAN_COSINE), out_albedo.rgb), 0.0);
    out_gloss = vec4(out_albedo.rgb - out_diffuse.rgb, mirror ? -max(s.glossy_roughness, 1e-3) : s.glossy_roughness);
  }
#endif
}
