// The point that a hit's record tells of, as surface/point.glsl has those of fragments: what belongs to the window comes
// from the ray's footprint.
SurfacePoint hit_point(ivec2 pixel, Instance instance, int id)
{
  vec4 place = hit_place_fetch(pixel);
  vec4 normals = hit_normals_fetch(pixel);
  SurfacePoint point;
  point.position = place.xyz;
  point.incoming = -ray_direction_fetch(pixel).xyz;
  vec3 plane_normal = octahedral_decode(normals.xy);
  bool in_front = dot(plane_normal, point.incoming) > 0.0;
  point.geometric_normal = in_front ? plane_normal : -plane_normal;
  point.backfacing = in_front == instance.mirrored;
  vec3 shading_normal = octahedral_decode(normals.zw);
  point.normal = point.backfacing ? -shading_normal : shading_normal;
  point.mesh_normal = point.normal;
  point.ray = RAY_GLOSSY;
  point.refracts = false;
  point.object_row0 = instance.row0;
  point.object_row1 = instance.row1;
  point.object_row2 = instance.row2;
  point.object_random = instance.random;
  point.object_index = instance.pass_index;
  instance_extras(id, point.object_color, point.instancer_generated, point.instancer_uv);
  point.object_attributes = instance_attributes(id);
  vec3 beside = cross(vec3(1.0), point.geometric_normal);
  beside = (dot(beside, beside) > 1e-12) ? beside : cross(vec3(-1.0, 1.0, 1.0), point.geometric_normal);
  point.position_dx = normalize(beside);
  point.position_dy = cross(point.geometric_normal, point.position_dx);
  point.position_dx *= place.w;
  point.position_dy *= place.w;
  fill_attributes(point, instance, hit_triangle_fetch(pixel));
  return point;
}
