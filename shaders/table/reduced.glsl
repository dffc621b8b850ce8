// An entry of a pyramid, least and largest value or mean, from 2x2 entries of the level below (addon/kernels/tables.py).
#include "generated/source"

vec4 reduced(ivec2 below)
{
#ifdef MEANS
  return 0.25 * (means_source(below) + means_source(below + ivec2(1, 0)) + means_source(below + ivec2(0, 1)) +
                 means_source(below + ivec2(1, 1)));
#else
  vec2 a = bounds_source(below);
  vec2 b = bounds_source(below + ivec2(1, 0));
  vec2 c = bounds_source(below + ivec2(0, 1));
  vec2 d = bounds_source(below + ivec2(1, 1));
  vec2 least = min(min(a, b), min(c, d));
  vec2 most = max(max(a, b), max(c, d));
  return vec4(least.x, most.y, 0.0, 0.0);
#endif
}
