// Radiance of a cell of a triangle towards surfaces that it lights, and that it was asked once: to be added up.
#include "surface/tile_view.glsl"

void main()
{
  bool behind;
  Closures c = closures_seen(tile_view(instance_flat.y == 1), RAY_LIGHT, behind);
  out_emission = is_finite(max_component(abs(c.emission))) ? vec4(c.emission, 1.0) : vec4(0.0);
}
