// How much of what a material shows is covered, and how much it shows, for the side that faces the viewer and the one turned
// away: to be added up.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"

void main()
{
  SurfacePoint point = surface_point(light_point.xyz, instance_read(instance_flat.x));
  point.ray = RAY_SHADOW;
  Closures c = closures_begin(point.normal, 0.5);
  evaluate_material(point, c);
  closures_end(c);
  float covered = 1.0 - clamp(dot(c.transparency, vec3(1.0 / 3.0)), 0.0, 1.0);
  out_opacity = point.backfacing ? vec4(0.0, 0.0, covered, 1.0) : vec4(covered, 1.0, 0.0, 0.0);
}
