// A photon on the picture: the light that the diffuse closure of a pixel reflects of it, with SOFT its lobe without microfacets
// (but for fibres), and with GLOSS its glossy lobe.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "caustics/receiver.glsl"
#include "caustics/arrival.glsl"
#include "caustics/least_cosine.glsl"
#ifdef GLOSS
#include "caustics/gloss.glsl"
#endif
#ifdef SOFT
#include "lib/soft_lobe.glsl"
#endif

#ifdef GLOSS
// What the lobe reflects of light from `direction`, per irradiance.
vec3 gloss_of(Surface s, vec3 direction)
{
  if (!gloss_takes_photons(s) || !may_mirror(s, direction)) {
    return vec3(0.0);
  }
  float density;
  vec3 reflected = lobe_reflection(lobe_begin(s, TO_VIEWER(s)), direction, density);
  return reflected / max(dot(s.geometric_normal, direction), LEAST_COSINE);
}
#endif

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 place = surface_position_fetch(pixel);
  out_light = vec4(0.0);
#ifdef TO_GLOSSY
  out_gloss = vec4(0.0);
#endif
  if (place.w == 0.0) {
    discard;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  float width = view_pixel() * view_growth_ahead(place.xyz);
  vec3 arriving = photon_irradiance(place.xyz, normal, 0.05 * width);
  float arrival = splat_centre.w;
  bool to_diffuse = arrives_on_diffuse(arrival);
  out_light = to_diffuse ? vec4(arriving * surface_diffuse_fetch(pixel).rgb / PI, 0.0) : vec4(0.0);
#ifdef TO_GLOSSY
  bool has_lobe = max_component(surface_tint_fetch(pixel).rgb) > 0.0;
  vec3 direction = arrival_direction(arrival);
#endif
#ifdef GLOSS
  if (has_lobe && arrives_on_gloss(arrival) && max_component(arriving) > 0.0) {
    out_gloss = vec4(arriving * gloss_of(SURFACE_READ(pixel), direction), 0.0);
  }
#endif
#ifdef SOFT
  int kind = lobe_kind(surface_lobe_fetch(pixel));
  vec3 onto_lobe = (kind == LOBE_TRANSLUCENT) ? photon_irradiance(place.xyz, -normal, 0.05 * width) : arriving;
  if (has_lobe && to_diffuse && kind > LOBE_REFRACTION && max_component(onto_lobe) > 0.0) {
    Surface s = SURFACE_READ(pixel);
    SoftLobe soft = soft_lobe_begin(s, TO_VIEWER(s));
    float cosine = max(abs(dot(s.geometric_normal, direction)), LEAST_COSINE);
    vec3 light = soft.fibre ? vec3(0.0) : onto_lobe * soft_reflection(soft, direction) / cosine;
    if (soft.glossy) {
      out_gloss = vec4(light, 0.0);
    }
    else {
      out_light.rgb += light;
    }
  }
#endif
}
