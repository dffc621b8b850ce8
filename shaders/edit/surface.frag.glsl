// The rotation of what an edited object mirrors or bends, as a quaternion, where the picture shows it.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "generated/distances"
#include "edit/solve.glsl"
#include "edit/lobe.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 seen = surface_position_fetch(pixel);
  vec3 to_eye = film_view.eye.xyz - seen.xyz;
  // Interpolated positions of one point differ by some units of the last place between two programs.
  if (seen.w == 0.0 || distance(seen.xyz, world_position) > 1e-5 * (length(to_eye) + length(seen.xyz))
      || max_component(surface_tint_fetch(pixel).rgb) <= 0.0) {
    discard;
  }
  vec4 q = edit_of_surface(SURFACE_READ(pixel), view_toward(seen.xyz));
  if (dot(q, q) == 0.0) {
    discard;
  }
  out_edit = q;
}
