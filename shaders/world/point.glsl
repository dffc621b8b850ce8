// The point at which a world's tree is evaluated for a ray along `direction`: one unit away, facing the ray.
#include "lib/closure.glsl"

SurfacePoint world_point(vec3 direction, int ray)
{
  SurfacePoint point;
  point.position = direction;
  point.normal = -direction;
  point.mesh_normal = -direction;
  point.geometric_normal = -direction;
  point.incoming = -direction;
  point.backfacing = false;
  point.ray = ray;
  point.refracts = false;
  point.object_row0 = vec4(1.0, 0.0, 0.0, 0.0);
  point.object_row1 = vec4(0.0, 1.0, 0.0, 0.0);
  point.object_row2 = vec4(0.0, 0.0, 1.0, 0.0);
  point.object_color = vec4(0.0);
  point.object_random = 0.0;
  point.object_index = 0.0;
  point.instancer_generated = vec3(0.0);
  point.instancer_uv = vec2(0.0);
  point.object_attributes = 0;
  point.position_dx = vec3(0.0);
  point.position_dy = vec3(0.0);
  for (int i = 0; i < 8; i++) {
    point.attributes[i] = vec4(0.0);
    point.attributes_dx[i] = vec4(0.0);
    point.attributes_dy[i] = vec4(0.0);
  }
  fill_attributes(point);
  return point;
}

vec3 world_radiance(vec3 direction, int ray)
{
  SurfacePoint point = world_point(direction, ray);
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  return c.emission;
}
