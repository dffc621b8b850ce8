// Marks what passes over the screen are about (see techniques/surfaces.py): 0 nothing was hit, 0.5 a surface, 1 a surface
// with a lobe up to `traced_roughness`.
#include "lib/gbuffer.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  bool hit = surface_position_fetch(pixel).w != 0.0;
  bool lobe = max_component(surface_tint_fetch(pixel).rgb) > 0.0 && (surface_emission_fetch(pixel).w <= traced_roughness || surface_lobe_fetch(pixel).z < 0.0);
  lobe = lobe && lobe_kind(surface_lobe_fetch(pixel)) <= LOBE_REFRACTION;  // no rays are traced from others
  gl_FragDepth = hit ? (lobe ? 1.0 : 0.5) : 0.0;
}
