// The point that a mesh fragment shades. Both normals are turned to the viewer's side, as Cycles does.

SurfacePoint surface_point(vec3 incoming, Instance instance)
{
  SurfacePoint point;
  point.position = world_position;
  point.incoming = incoming;
  // The plane of the triangle itself: interpolated normals say nothing about what the light can reach.
  vec3 flat_normal = safe_normalize(cross(dFdx(world_position), dFdy(world_position)));
  if (dot(flat_normal, incoming) < 0.0) {
    flat_normal = -flat_normal;
  }
  point.geometric_normal = flat_normal;
  point.backfacing = gl_FrontFacing == (instance_flat.y == 1);
  vec3 shading_normal = safe_normalize(world_normal);
  if (dot(shading_normal, shading_normal) < 0.5) {
    shading_normal = flat_normal;
  }
  else if (point.backfacing) {
    shading_normal = -shading_normal;
  }
  point.normal = shading_normal;
  point.object_random = instance.random;
  fill_attributes(point);
  return point;
}
