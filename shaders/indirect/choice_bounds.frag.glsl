// Bounds of what a part of the candidates say: of every PARTS-th.
#include "indirect/choice.glsl"

void main()
{
  vec3 low = vec3(1e30);
  vec3 high = vec3(-1e30);
  for (int i = int(gl_FragCoord.x); i < candidate_count; i += PARTS) {
    vec4 point = candidate_point_fetch(candidate_place(i));
    if (point.w != 0.0) {
      vec3 place = within_reach(point.xyz);
      low = min(low, place);
      high = max(high, place);
    }
  }
  out_low = vec4(low, 0.0);
  out_high = vec4(high, 0.0);
}
