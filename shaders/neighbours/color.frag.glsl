// Colour of all that is diffuse, and of which kind the lobe in it is (w; 0: there is none, -1: of a fibre).
#include "lib/gbuffer.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_color = vec4(0.0);
  vec4 position = surface_position_fetch(pixel);
  if (position.w != 0.0) {
    Surface s = surface_decode(position, surface_normal_fetch(pixel), surface_diffuse_fetch(pixel),
                               surface_tint_fetch(pixel), surface_lobe_fetch(pixel), vec4(0.0));
    out_color = vec4(diffuse_color(s), has_diffuse_lobe(s) ? (is_fibre(s) ? -1.0 : float(s.kind)) : 0.0);
  }
}
