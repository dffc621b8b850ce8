// How far a material displaces a place, in metres in world space; w: how much of it is along the normal.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"

void main()
{
  Instance instance = instance_read(0);
  vec3 outwards = safe_normalize(world_normal);
  SurfacePoint point = surface_point(outwards, instance);
  // A point of a list has no neighbours in the window.
  point.normal = outwards;
  point.mesh_normal = outwards;
  point.geometric_normal = outwards;
  point.backfacing = false;
  point.position_dx = vec3(0.0);
  point.position_dy = vec3(0.0);
  for (int i = 0; i < 8; i++) {
    point.attributes_dx[i] = vec4(0.0);
    point.attributes_dy[i] = vec4(0.0);
  }
  vec3 moved = finite_or_black(material_displacement(point));
  out_displacement = vec4(moved, dot(moved, outwards));
}
