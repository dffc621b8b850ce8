// The radiance with which each pixel's surface lights others, the same to all sides.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "indirect/albedo.glsl"

void main()
{
  out_senders = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  vec3 viewer = TO_VIEWER(s);
  vec3 whole = surface_albedo(s, max(dot(s.geometric_normal, viewer), 0.0));
#ifdef FROM_LIGHT
  // What this sample found. Glossy reflection is added as even.
  vec3 reflected = direct_fetch(pixel).rgb;
  float diffuse = luminance(s.diffuse);
  bool microfacets = s.kind <= FRESNEL_F82;
  out_senders.rgb = reflected * ((microfacets && diffuse > 0.0) ? luminance(whole) / diffuse : 1.0);
#else
  out_senders.rgb = arriving_fetch(pixel).rgb * whole;
#endif
}
