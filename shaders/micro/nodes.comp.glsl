// Micro-buffers at points of the tree, both sides of each: entry 2 i + side of the list of those that gather, whose leaf
// numbers are their group's first and `chosen` more. `gathering` says which thread draws which entry, and negative for sides
// from which nothing is seen: their buffers stay empty.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "micro/buffer.glsl"
#include "micro/gathering.glsl"

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  if (place.x >= NODE_ROW || place.y * NODE_ROW + place.x >= 2 * group_count) {
    return;
  }
  int listed = int(gathering_fetch(place).x);
  int entry = abs(listed) - 1;
  place = ivec2(entry % NODE_ROW, entry / NODE_ROW);
  vec3 axis;
  vec3 middle = leaf_middle(gathering_leaf(entry >> 1), axis);
  vec3 normal = axis * (((entry & 1) == 0) ? 1.0 : -1.0);
  uvec3 salt = hash3(uvec3(uint(entry), 71u, 3u));
  vec3 own = fract(buffer_choice.yzw + vec3(to_unit(salt.x), to_unit(salt.y), to_unit(salt.z)));
  MicroFrame f = micro_frame(middle, normal, normal, own);
  if (part.x == 0) {
    micro_clear(place * micro_side);
  }
  if (listed > 0) {
    micro_fill(f, place * micro_side);
  }
}
