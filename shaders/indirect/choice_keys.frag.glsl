// Keys by which candidates stand side by side that are near each other and face alike: the side that they face, then
// the place along a Morton curve. Those that met nothing come last.
#include "indirect/choice.glsl"

uint spread_bits(uint x)  // nine bits, each three places apart
{
  x = (x | (x << 16u)) & 0x030000FFu;
  x = (x | (x << 8u)) & 0x0300F00Fu;
  x = (x | (x << 4u)) & 0x030C30C3u;
  return (x | (x << 2u)) & 0x09249249u;
}

void main()
{
  out_key = 0xFFFFFFFFu;
  ivec2 place = ivec2(gl_FragCoord.xy);
  int index = place.y * LIST_COLUMNS + place.x;
  if (index >= candidate_count) {
    return;
  }
  vec4 point = candidate_point_fetch(candidate_place(index));
  if (point.w == 0.0) {
    return;
  }
  vec3 low = vec3(1e30);
  vec3 high = vec3(-1e30);
  for (int k = 0; k < PARTS; k++) {
    low = min(low, bounds_low_fetch(ivec2(k, 0)).xyz);
    high = max(high, bounds_high_fetch(ivec2(k, 0)).xyz);
  }
  // Of a size that pictures have in common that see about the same: what is kept is then about the same, too.
  float side = exp2(ceil(log2(max(max_component(high - low), 1e-30))));
  // A little less than 512 cells: a wall at a round number stands at the edge of a cell, as a whole.
  vec3 grid = (within_reach(point.xyz) - floor(low / side) * side) * (511.9998 / (2.0 * side));
  uvec3 cell = uvec3(clamp(grid, vec3(0.0), vec3(511.0)));
  vec3 normal = candidate_normal_fetch(candidate_place(index)).xyz;
  vec3 along = abs(normal);
  int axis = (along.x >= along.y && along.x >= along.z) ? 0 : ((along.y >= along.z) ? 1 : 2);
  uint side_faced = uint(2 * axis + ((normal[axis] < 0.0) ? 1 : 0));
  out_key = (side_faced << 27u) | spread_bits(cell.x) | (spread_bits(cell.y) << 1u) | (spread_bits(cell.z) << 2u);
}
