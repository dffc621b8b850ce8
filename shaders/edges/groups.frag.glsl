// quads.frag.glsl by group: each group has a digit of base 256 in one of sixteen channels.
#include "edges/light.glsl"

vec4 in_channel(int slot, int image_number, float value)
{
  float digit = value * exp2(float(8 * (slot % 3)));
  bvec4 own = equal(ivec4(slot / 3), ivec4(4 * image_number) + ivec4(0, 1, 2, 3));
  vec4 channel = mix(vec4(0.0), vec4(1.0), own);
  return channel * digit;
}

void main()
{
  vec4 receiver = receivers_fetch(ivec2(gl_FragCoord.xy));
  vec3 p = receiver.xyz;
#ifdef TRIANGLES
  bool side = plane_side(flat_a, p) >= 0.0;
  bool crosses = receiver.w != 0.0 && side != (flat_b.y >= 0.0);
  float change = ((flat_b.x >= 0.0) != side) ? 1.0 : -1.0;
  int slot = int(flat_b.z);
#else
  bool side = centre_side(flat_a.xyz - p, flat_b.xyz - p, towards_centre(p)) >= 0.0;
  bool crosses = receiver.w != 0.0 && side != (flat_b.w >= 0.0);
  float change = side ? flat_a.w : -flat_a.w;
  int slot = int(flat_group);
#endif
  change = crosses ? change : 0.0;
  out_a = in_channel(slot, 0, change);
  out_b = in_channel(slot, 1, change);
  out_c = in_channel(slot, 2, change);
  out_d = in_channel(slot, 3, change);
}
