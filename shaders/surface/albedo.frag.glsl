// What the surfaces of the surface images reflect, glossy reflection included, and where they are.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "indirect/albedo.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_position = surface_position_fetch(pixel);
  out_albedo = vec4(0.0);
  if (out_position.w != 0.0) {
    Surface s = SURFACE_READ(pixel);
    vec3 to_viewer = TO_VIEWER(s);
    out_albedo.rgb = surface_albedo(s, max(dot(s.geometric_normal, to_viewer), 0.0));
  }
}
