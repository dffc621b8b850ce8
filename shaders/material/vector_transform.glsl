// Vector Transform: from one space to world space, and from there to another. Camera space runs x right, y up and z
// into the picture; its axes are orthonormal, so its normals go like its directions.

#include "lib/closure.glsl"

#define SPACE_WORLD 0
#define SPACE_OBJECT 1
#define SPACE_CAMERA 2

vec3 world_from_camera(vec3 v)
{
  return v.x * material_scene.camera_right.xyz + v.y * material_scene.camera_up.xyz
         - v.z * material_scene.camera_backward.xyz;
}

vec3 camera_from_world(vec3 v)
{
  return vec3(dot(v, material_scene.camera_right.xyz), dot(v, material_scene.camera_up.xyz),
              -dot(v, material_scene.camera_backward.xyz));
}

// In between, points are relative to the render origin.
void transform_point(SurfacePoint point, vec3 vector, int from, int to, out vec3 result)
{
  vec3 world = vector - material_scene.origin.xyz;
  if (from == SPACE_OBJECT) {
    world = world_from_object(point, vector) + object_place(point);
  }
  else if (from == SPACE_CAMERA) {
    world = world_from_camera(vector) + material_scene.camera_position.xyz;
  }
  result = world + material_scene.origin.xyz;
  if (to == SPACE_OBJECT) {
    result = object_from_world(point, world - object_place(point));
  }
  else if (to == SPACE_CAMERA) {
    result = camera_from_world(world - material_scene.camera_position.xyz);
  }
  result = (from == to) ? vector : result;
}

void transform_vector(SurfacePoint point, vec3 vector, int from, int to, out vec3 result)
{
  vec3 world = vector;
  if (from == SPACE_OBJECT) {
    world = world_from_object(point, vector);
  }
  else if (from == SPACE_CAMERA) {
    world = world_from_camera(vector);
  }
  result = world;
  if (to == SPACE_OBJECT) {
    result = object_from_world(point, world);
  }
  else if (to == SPACE_CAMERA) {
    result = camera_from_world(world);
  }
  result = (from == to) ? vector : result;
}

void transform_normal(SurfacePoint point, vec3 vector, int from, int to, out vec3 result)
{
  vec3 world = vector;
  if (from == SPACE_OBJECT) {
    world = world_from_object_normal(point, vector);
  }
  else if (from == SPACE_CAMERA) {
    world = safe_normalize(world_from_camera(vector));
  }
  result = world;
  if (to == SPACE_OBJECT) {
    result = object_from_world_normal(point, world);
  }
  else if (to == SPACE_CAMERA) {
    result = safe_normalize(camera_from_world(world));
  }
  result = (from == to) ? vector : result;
}
