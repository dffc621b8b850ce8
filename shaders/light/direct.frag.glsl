// Direct light of this sample: one point on each light, visibility from its depth maps.
//
// The point is the same for all pixels, so a narrow glossy lobe would see a few bright dots. Where rays are traced
// (light/traced.frag.glsl) such lobes take part of their light from there; both are weighted by the balance of squared
// densities (Veach's power heuristic), so the sum has the same mean.
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#ifdef SOFT_LOBES
#include "lib/soft_lobe.glsl"
#endif
#include "lib/shadow.glsl"
#include "light/sources.glsl"

void main()
{
  out_diffuse = vec4(0.0);
  out_glossy = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (texelFetch(surface_position, pixel, 0).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  vec3 to_viewer = (film_view.eye.w > 0.5) ? film_view.backward.xyz : safe_normalize(film_view.eye.xyz - s.position);
  bool has_diffuse = max_component(s.diffuse) > 0.0;
  bool has_glossy = max_component(s.glossy_weight) > 0.0;
#ifdef SOFT_LOBES
  SoftLobe soft = soft_lobe_begin(s, to_viewer);
  has_glossy = has_glossy && !soft.exists;
#endif
  Lobe lobe;
  if (has_glossy) {
    lobe = lobe_begin(s, to_viewer);
    has_glossy = !lobe_is_mirror(lobe);
  }
  bool traced = s.glossy_roughness <= traced_roughness;
  vec3 diffuse = vec3(0.0);
  vec3 glossy = vec3(0.0);
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    vec3 direction;
    float density;
    vec3 arriving = light_sample(light, s.position, direction, density);
    vec3 from_diffuse = vec3(0.0);
    vec3 from_glossy = vec3(0.0);
    if (has_diffuse && (light.flags & LIGHT_DIFFUSE) != 0) {
      from_diffuse = diffuse_reflection(s.diffuse, s.diffuse_roughness, s.normal, to_viewer, direction);
    }
    if (has_glossy && (light.flags & LIGHT_GLOSSY) != 0) {
      float lobe_density;
      from_glossy = lobe_reflection(lobe, direction, lobe_density);
      if (traced && density > 0.0 && (light.flags & LIGHT_TRACED) != 0) {
        float rays = (light.kind == LIGHT_SURFACE) ? 1.0 : float(CANDIDATES);
        float ratio = rays * lobe_density / (light.rate * density);
        from_glossy /= 1.0 + ratio * ratio;
      }
    }
    vec3 facing = s.geometric_normal;
#ifdef SOFT_LOBES
    if (soft.exists) {
      vec3 from_soft = soft_reflection(soft, direction);
      from_diffuse += ((light.flags & LIGHT_DIFFUSE) != 0 && !soft.glossy) ? from_soft : vec3(0.0);
      from_glossy += ((light.flags & LIGHT_GLOSSY) != 0 && soft.glossy) ? from_soft : vec3(0.0);
      facing *= (soft.kind == LOBE_TRANSLUCENT && dot(direction, facing) < 0.0) ? -1.0 : 1.0;
    }
#endif
    from_diffuse *= arriving;
    from_glossy *= arriving;
    if (max_component(abs(from_diffuse) + abs(from_glossy)) > 0.0) {
      float visibility = 1.0;
      if ((light.flags & LIGHT_SHADOW) != 0) {
        visibility = shadow_visibility(light.first_view, light.view_count, s.position, facing);
      }
      diffuse += from_diffuse * visibility;
      glossy += from_glossy * visibility;
    }
  }
  out_diffuse = vec4(diffuse, 0.0);
  out_glossy = vec4(glossy, 0.0);
}
