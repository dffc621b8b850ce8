// What a material is at a point of a mesh for rays of a kind, without lots, and from which side it is seen.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"

Closures closures_seen(vec3 incoming, int ray, out bool behind)
{
  SurfacePoint point = surface_point(incoming, instance_read(instance_flat.x));
  point.ray = ray;
  behind = point.backfacing;
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  return c;
}
