// A caster between the eye and the receiver: the way from the eye goes through it, to where it hides the light's centre or
// from there.
#include "edges/light.glsl"

void main()
{
  vec4 receiver = receivers_fetch(ivec2(gl_FragCoord.xy));
  bool of_receiver = plane_side(flat_a, receiver.xyz) >= 0.0;
  bool crosses = receiver.w != 0.0 && of_receiver != (flat_b.y >= 0.0);
  float change = ((flat_b.x >= 0.0) != of_receiver) ? 1.0 : -1.0;
  out_count = vec4(crosses ? change : 0.0, 0.0, 0.0, 0.0);
}
