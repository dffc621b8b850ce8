// A shadow quad between the eye and the receiver changes the number of layers before the light's centre by its weight.
#include "edges/light.glsl"

void main()
{
  vec4 receiver = receivers_fetch(ivec2(gl_FragCoord.xy));
  vec3 p = receiver.xyz;
  bool side = centre_side(flat_a.xyz - p, flat_b.xyz - p, towards_centre(p)) >= 0.0;
  bool crosses = receiver.w != 0.0 && side != (flat_b.w >= 0.0);
  out_count = vec4(crosses ? (side ? flat_a.w : -flat_a.w) : 0.0, 0.0, 0.0, 0.0);
}
