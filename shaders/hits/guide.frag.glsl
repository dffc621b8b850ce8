// What reflections show, for whoever filters them: how much surfaces behind the lobe reflect, as it is seen in it, and in w
// the square of its luminance. The mean over samples, and how uncertain that is, tell one part of a reflection from
// another.
#include "lib/gbuffer.glsl"
#include "hits/path.glsl"

void main()
{
  out_shown = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 path = met_path_fetch(pixel);
  if (!path_is_glossy(int(path.w + 0.5)) || surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  bool goes_on = s.kind == LOBE_REFRACTION || s.glossy_roughness <= shaded_roughness;
  vec3 of_lobe = (s.kind == FRESNEL_DIELECTRIC || goes_on) ? vec3(0.0) : s.glossy_weight;
  vec3 color = min(path.rgb, vec3(1.0)) * (s.diffuse + of_lobe + min(s.emission, vec3(1.0)));
  float bright = luminance(color);
  out_shown = is_finite(bright) ? vec4(color, bright * bright) : vec4(0.0);
}
