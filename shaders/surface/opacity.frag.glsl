// How much of what a material shows is covered, and how much it shows, for the side that faces the viewer and the one turned
// away: to be added up.
#include "surface/seen.glsl"

void main()
{
  bool behind;
  Closures c = closures_seen(RAY_SHADOW, behind);
  float covered = 1.0 - clamp(dot(c.transparency, vec3(1.0 / 3.0)), 0.0, 1.0);
  out_opacity = behind ? vec4(0.0, 0.0, covered, 1.0) : vec4(covered, 1.0, 0.0, 0.0);
}
