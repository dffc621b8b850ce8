// How much of a cell is covered, and that it was asked once, for the front and for the back: to be added up. COLORED: and
// what passes, of both.
#include "surface/tile_view.glsl"

void main()
{
  bool back = instance_flat.y == 1;
  bool behind;
  Closures c = closures_seen(tile_view(back), RAY_SHADOW, behind);
  float covered = 1.0 - clamp(dot(c.transparency, vec3(1.0 / 3.0)), 0.0, 1.0);
  covered = is_finite(covered) ? covered : 1.0;
  out_opacity = back ? vec4(0.0, 0.0, covered, 1.0) : vec4(covered, 1.0, 0.0, 0.0);
#ifdef COLORED
  out_passing = vec4(max(c.transparency, vec3(0.0)), 1.0);
#endif
}
