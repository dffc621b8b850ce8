// Micro-buffers at points of the tree, both sides of each: entry 2 i + side of the list of those that gather, whose leaf
// numbers are their group's first and `chosen` more. `gathering` says which thread draws which entry, and negative for sides
// from which nothing is seen: their buffers stay empty.
#include "lib/math.glsl"
#include "micro/buffer.glsl"
#include "micro/gathering_frame.glsl"

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  if (place.x >= NODE_ROW || place.y * NODE_ROW + place.x >= 2 * group_count) {
    return;
  }
  int listed = int(gathering_fetch(place).x);
  int entry = abs(listed) - 1;
  place = ivec2(entry % NODE_ROW, entry / NODE_ROW);
  MicroFrame f = gathering_frame(entry);
  if (part.x == 0) {
    micro_clear(place * micro_side);
  }
  if (listed > 0) {
    micro_fill(f, place * micro_side);
  }
}
