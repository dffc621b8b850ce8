// What reflections show, and what is seen through glass, for whoever filters them: how much surfaces behind the lobe
// reflect, as it is seen in it, and in w the square of its luminance, both times the `ray_share` of the rays. The mean over
// samples, and how uncertain that is, tell one part of a reflection from another.
#include "lib/gbuffer.glsl"
#include "hits/path.glsl"
#include "hits/onward.glsl"

void main()
{
  out_shown = vec4(0.0);
#ifdef TRANSMISSION
  out_through = vec4(0.0);
#endif
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 path = met_path_fetch(pixel);
  int code = int(path.w + 0.5);
  if (code == 0 || surface_position_fetch(pixel).w == 0.0) {
    return;
  }
#ifndef TRANSMISSION
  if (!path_is_glossy(code)) {
    return;
  }
#endif
  Surface s = SURFACE_READ(pixel);
  bool goes_on = lobe_goes_on(s);
  vec3 of_lobe = (s.kind == FRESNEL_DIELECTRIC || goes_on) ? vec3(0.0) : s.glossy_weight;
  vec3 color = min(path.rgb / ray_share, vec3(1.0)) * (s.diffuse + of_lobe + min(s.emission, vec3(1.0)));
  float bright = luminance(color);
  vec4 shown = is_finite(bright) ? ray_share * vec4(color, bright * bright) : vec4(0.0);
#ifdef TRANSMISSION
  out_through = path_is_glossy(code) ? vec4(0.0) : shown;
#endif
  out_shown = path_is_glossy(code) ? shown : vec4(0.0);
}
