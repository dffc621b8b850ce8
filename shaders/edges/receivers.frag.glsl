// Where shadows of one light are asked for: points just beside the surfaces, on the side that the light is expected from.
// w: +1; -1 where light shines through and the point lies behind the surface; 0: nothing to ask, as no light arrives.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "light/terminator.glsl"
#include "edges/light.glsl"

// How far beside a surface: what float32 positions of this size cannot tell apart (as in trace/rays.glsl).
float receiver_offset(vec3 position)
{
  return max(edge_light.size.w, 2e-5 * view_reach(position));
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_receiver = vec4(0.0);
  if (surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  vec3 to_centre = towards_centre(s.position);
  float span = light_at_infinity() ? 1.0 : length(to_centre);
  vec3 towards = safe_normalize(to_centre);
  float side = shines_through(s.kind, s.normal, towards) ? -1.0 : 1.0;
  vec3 facing = side * s.geometric_normal;
  float below = -edge_light.size.x - 1e-4 * span;
  if (s.kind != LOBE_TRANSLUCENT && dot(s.normal, to_centre) < below && dot(s.geometric_normal, to_centre) < below) {
    return;  // all of the light lies behind the surface
  }
  vec3 start = light_start(s.position, side * s.normal, facing, (side < 0.0) ? s.sink : s.lift, towards, facing);
  out_receiver = vec4(start + facing * receiver_offset(s.position), side);
}
