// How much of a cell is covered, and that it was asked once, for the front and for the back: to be added up.
#include "surface/tile_view.glsl"

void main()
{
  bool back = instance_flat.y == 1;
  bool behind;
  Closures c = closures_seen(tile_view(back), RAY_SHADOW, behind);
  float covered = 1.0 - clamp(dot(c.transparency, vec3(1.0 / 3.0)), 0.0, 1.0);
  covered = is_finite(covered) ? covered : 1.0;
  out_opacity = back ? vec4(0.0, 0.0, covered, 1.0) : vec4(covered, 1.0, 0.0, 0.0);
}
