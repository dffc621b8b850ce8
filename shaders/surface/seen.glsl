// What a material is at a point of a mesh for rays of a kind, without random choices, and from which side it is seen.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"

Closures closures_seen(vec3 incoming, int ray, out bool behind)
{
  Instance instance = instance_read(instance_flat.x);
  SurfacePoint point = surface_point(incoming, instance);
  point.ray = ray;
#ifdef OWN_SURFACE
  gl_FragDepth = gl_FragCoord.z;
  if (!own_surface(point, instance)) {
    discard;
  }
#endif
  behind = point.backfacing;
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  return c;
}
