// A photon on the picture: the light that the diffuse closure of a pixel reflects of it, and, with GLOSS, its glossy lobe.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "caustics/receiver.glsl"
#ifdef GLOSS
#include "caustics/gloss.glsl"

// What the lobe reflects of light from `direction`, per irradiance.
vec3 gloss_of(ivec2 pixel, vec3 direction)
{
  Surface s = SURFACE_READ(pixel);
  if (!gloss_takes_photons(s) || !may_mirror(s, direction)) {
    return vec3(0.0);
  }
  float density;
  vec3 reflected = lobe_reflection(lobe_begin(s, TO_VIEWER(s)), direction, density);
  return reflected / max(dot(s.geometric_normal, direction), 1e-2);
}
#endif

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 place = surface_position_fetch(pixel);
  out_light = vec4(0.0);
#ifdef GLOSS
  out_gloss = vec4(0.0);
#endif
  if (place.w == 0.0) {
    discard;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  float width = view_pixel() * view_growth_ahead(place.xyz);
  vec3 arriving = photon_irradiance(place.xyz, normal, 0.05 * width);
  out_light = (splat_centre.w > 0.0) ? vec4(arriving * surface_diffuse_fetch(pixel).rgb / PI, 0.0) : vec4(0.0);
#ifdef GLOSS
  float came = abs(splat_centre.w) - 1.0;
  bool lit = max_component(arriving) > 0.0 && came >= 0.0;
  if (lit && max_component(surface_tint_fetch(pixel).rgb) > 0.0) {
    out_gloss = vec4(arriving * gloss_of(pixel, unpack_normal(came)), 0.0);
  }
#endif
}
