// Candidates for virtual lights in a list, by number: `rays` of a probe side by side, see indirect/candidates.frag.glsl.
#include "lib/math.glsl"

ivec2 candidate_place(int index)
{
  return ivec2(index % rays, index / rays);
}

// What is far beyond what the camera sees counts as at the edge of a box around that.
vec3 within_reach(vec3 position)
{
  return clamp(position, seen_middle.xyz - seen_middle.w, seen_middle.xyz + seen_middle.w);
}
