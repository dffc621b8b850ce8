#include "lib/random.glsl"
#include "micro/frame.glsl"
#include "micro/gathering.glsl"

// Frame of the micro-buffer of entry 2 group + side.
MicroFrame gathering_frame(int entry)
{
  vec3 axis;
  vec3 middle = leaf_middle(gathering_leaf(entry >> 1), axis);
  vec3 normal = axis * (((entry & 1) == 0) ? 1.0 : -1.0);
  uvec3 salt = hash3(uvec3(uint(entry), 71u, 3u));
  vec3 own = fract(buffer_choice.yzw + vec3(to_unit(salt.x), to_unit(salt.y), to_unit(salt.z)));
  return micro_frame(middle, normal, normal, own);
}
