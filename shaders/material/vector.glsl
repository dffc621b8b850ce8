// Nodes that turn and bend vectors.

#include "lib/closure.glsl"
#include "lib/math.glsl"

// Rotation by Euler angles in radians, about x first, then y, then z.
mat3 mapping_rotation(vec3 angles)
{
  vec3 c = cos(angles);
  vec3 s = sin(angles);
  return mat3(vec3(c.y * c.z, c.y * s.z, -s.y),
              vec3(s.x * s.y * c.z - c.x * s.z, s.x * s.y * s.z + c.x * c.z, s.x * c.y),
              vec3(c.x * s.y * c.z + s.x * s.z, c.x * s.y * s.z - s.x * c.z, c.x * c.y));
}

vec3 divided_by(vec3 a, vec3 b)
{
  return vec3((b.x != 0.0) ? a.x / b.x : 0.0, (b.y != 0.0) ? a.y / b.y : 0.0, (b.z != 0.0) ? a.z / b.z : 0.0);
}

void mapping_point(vec3 vector, vec3 location, vec3 rotation, vec3 scale, out vec3 result)
{
  result = mapping_rotation(rotation) * (vector * scale) + location;
}

void mapping_texture(vec3 vector, vec3 location, vec3 rotation, vec3 scale, out vec3 result)
{
  result = divided_by((vector - location) * mapping_rotation(rotation), scale);
}

void mapping_vector(vec3 vector, vec3 location, vec3 rotation, vec3 scale, out vec3 result)
{
  result = mapping_rotation(rotation) * (vector * scale);
}

void mapping_normal(vec3 vector, vec3 location, vec3 rotation, vec3 scale, out vec3 result)
{
  vec3 turned = mapping_rotation(rotation) * divided_by(vector, scale);
  float length_squared = dot(turned, turned);
  result = (length_squared > 1e-20) ? turned * inversesqrt(length_squared) : vec3(0.0);
}

// The colours of a normal map as a vector; DirectX runs green downwards.
vec3 normal_map_vector(vec3 color, bool directx)
{
  vec3 mapped = 2.0 * color - vec3(1.0);
  return directx ? vec3(mapped.x, -mapped.y, mapped.z) : mapped;
}

// Tangent-space normal map. `tangent` is in object space with the bitangent's sign in w; the map is defined on the
// front of the surface, so the mesh's normal is turned there and the result turned back. Displacement does not turn it.
void normal_map_tangent(SurfacePoint point, vec4 tangent, float strength, vec3 color, bool directx, out vec3 normal)
{
  float side = point.backfacing ? -1.0 : 1.0;
  vec3 n = side * object_from_world_normal(point, point.mesh_normal);
  vec3 bitangent = tangent.w * cross(n, tangent.xyz);
  vec3 mapped = normal_map_vector(color, directx);
  mapped.xy *= strength;
  mapped.z = mix(1.0, mapped.z, clamp(strength, 0.0, 1.0));
  vec3 turned = mapped.x * tangent.xyz + mapped.y * bitangent + mapped.z * n;
  normal = (dot(tangent.xyz, tangent.xyz) > 0.0 && dot(turned, turned) > 1e-20)
               ? side * world_from_object_normal(point, turned) : point.normal;
}

// Strength of maps that are not in tangent space: the straight way from the surface's normal to the map's.
vec3 normal_map_blend(SurfacePoint point, float strength, vec3 mapped)
{
  float map_length = length(mapped);
  vec3 target = (map_length > 1e-10) ? (point.backfacing ? -mapped : mapped) / map_length : point.normal;
  vec3 turned = point.normal + (target - point.normal) * max(strength, 0.0);
  return (dot(turned, turned) > 1e-20) ? normalize(turned) : point.normal;
}

void normal_map_world(SurfacePoint point, float strength, vec3 color, bool directx, out vec3 normal)
{
  normal = normal_map_blend(point, strength, normal_map_vector(color, directx));
}

void normal_map_object(SurfacePoint point, float strength, vec3 color, bool directx, out vec3 normal)
{
  vec3 mapped = world_from_object_normal(point, normal_map_vector(color, directx));
  normal = normal_map_blend(point, strength, mapped);
}

// Maps that old Blenders baked run y and z the other way.
void normal_map_blender_world(SurfacePoint point, float strength, vec3 color, bool directx, out vec3 normal)
{
  normal = normal_map_blend(point, strength, normal_map_vector(color, directx) * vec3(1.0, -1.0, -1.0));
}

void normal_map_blender_object(SurfacePoint point, float strength, vec3 color, bool directx, out vec3 normal)
{
  vec3 mapped = world_from_object_normal(point, normal_map_vector(color, directx) * vec3(1.0, -1.0, -1.0));
  normal = normal_map_blend(point, strength, mapped);
}

void normal_node(vec3 direction, vec3 given, out vec3 normal, out float cosine)
{
  normal = safe_normalize(direction);
  cosine = dot(normal, safe_normalize(given));
}

// Rodrigues' rotation.
vec3 rotated_about(vec3 v, vec3 axis, float angle)
{
  float c = cos(angle);
  return v * c + cross(axis, v) * sin(angle) + axis * dot(axis, v) * (1.0 - c);
}

void rotate_axis_angle(vec3 vector, vec3 center, vec3 axis, float angle, bool invert, out vec3 result)
{
  float axis_length = length(axis);
  result = (axis_length != 0.0)
               ? rotated_about(vector - center, axis / axis_length, invert ? -angle : angle) + center : vector;
}

void rotate_x_axis(vec3 vector, vec3 center, float angle, bool invert, out vec3 result)
{
  rotate_axis_angle(vector, center, vec3(1.0, 0.0, 0.0), angle, invert, result);
}

void rotate_y_axis(vec3 vector, vec3 center, float angle, bool invert, out vec3 result)
{
  rotate_axis_angle(vector, center, vec3(0.0, 1.0, 0.0), angle, invert, result);
}

void rotate_z_axis(vec3 vector, vec3 center, float angle, bool invert, out vec3 result)
{
  rotate_axis_angle(vector, center, vec3(0.0, 0.0, 1.0), angle, invert, result);
}

void rotate_euler_xyz(vec3 vector, vec3 center, vec3 rotation, bool invert, out vec3 result)
{
  mat3 turn = mapping_rotation(rotation);
  vec3 arm = vector - center;
  result = (invert ? arm * turn : turn * arm) + center;
}

// Sectors of a regular polygon around z: coordinates along a sector's side and away from the centre, the sector's number,
// half the length of its side at distance 1, and the angle of its middle.
void radial_tiling(vec3 vector, float sides, bool normalized, out vec3 coordinates, out float number, out float width,
                   out float rotation)
{
  float sector = 2.0 * PI / max(sides, 2.0);
  float half_sector = 0.5 * sector;
  float angle = (vector.x == 0.0 && vector.y == 0.0) ? 0.0 : atan(vector.y, vector.x);
  angle += (vector.y < 0.0) ? 2.0 * PI : 0.0;
  number = floor(angle / sector);
  float beside = angle - number * sector - half_sector;
  float away = length(vector.xy);
  vec2 place = away * vec2(sin(beside), cos(beside));
  width = (sides > 2.0) ? tan(half_sector) : 0.0;
  rotation = number * sector + half_sector;
  if (normalized) {
    float reach = place.y * width;
    coordinates = vec3((reach > 0.0) ? 0.5 + 0.5 * place.x / reach : 0.0, place.y, 0.0);
  }
  else {
    coordinates = vec3(place.x, place.y - 1.0, 0.0);
  }
}
