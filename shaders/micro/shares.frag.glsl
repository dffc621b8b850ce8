// From which group each point takes the light that it reflects once more: of its own and those beside it in the tree, the first
// whose gathering point faces alike and lies in view; its own, where none does. So what is gathered on one side of a wall stays
// there, but for a point that is shut in.
//
// Rays between both points run in an arch, as high as RISE of their distance: a bent surface does not hide its own points.
#include "lib/math.glsl"
#include "trace/rays.glsl"
#include "micro/gathering.glsl"

#define RISE 0.25
#define ALIKE 0.7
#define CANDIDATES 8

void main()
{
  out_share = 0.0;
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int entry = pixel.y * POINT_ROW + pixel.x;
  float side = ((entry & 1) == 0) ? 1.0 : -1.0;
  int group_size = leaf_count / group_count;
  int own = (entry >> 1) / group_size;
  out_share = float(2 * own + (entry & 1));
  vec3 axis;
  vec3 middle = leaf_middle(leaf_count + (entry >> 1), axis);
  for (int k = 0; k < CANDIDATES; k++) {
    int group = own ^ k;
    if (group >= group_count) {
      continue;
    }
    vec3 other_axis;
    vec3 other = leaf_middle(gathering_leaf(group), other_axis);
    // A bent group may have a gathering point that faces another way.
    if (k > 0 && dot(axis, other_axis) < ALIKE) {
      continue;
    }
    float apart = length(other - middle);
    float above = RISE * apart + 8.0 * offset_size;
    vec3 from = middle + above * side * axis;
    vec3 way = other + above * side * other_axis - from;
    float distance = length(way);
    ivec2 hit;
    bool clear = apart <= 0.0 || trace_until(from, way / max(distance, 1e-30), distance, distance, 0u, hit) >= distance;
    if (clear) {
      out_share = float(2 * group + (entry & 1));
      break;
    }
  }
}
