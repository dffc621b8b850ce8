// Nodes that turn and bend vectors.

#include "lib/closure.glsl"

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

// Tangent-space normal map. `tangent` is in world space with the bitangent's sign in w; the map is defined on the
// front of the surface, so the point's normal is turned there and the result turned back.
void normal_map_tangent(SurfacePoint point, vec4 tangent, float strength, vec3 color, out vec3 normal)
{
  float side = point.backfacing ? -1.0 : 1.0;
  vec3 n = side * point.normal;
  vec3 t = tangent.xyz;
  vec3 bitangent = tangent.w * cross(n, t);
  vec3 mapped = 2.0 * color - vec3(1.0);
  mapped.xy *= strength;
  mapped.z = mix(1.0, mapped.z, clamp(strength, 0.0, 1.0));
  vec3 turned = mapped.x * t + mapped.y * bitangent + mapped.z * n;
  float length_squared = dot(turned, turned);
  normal = (length_squared > 1e-20) ? side * turned * inversesqrt(length_squared) : point.normal;
}

void normal_map_world(SurfacePoint point, float strength, vec3 color, out vec3 normal)
{
  float side = point.backfacing ? -1.0 : 1.0;
  vec3 mapped = 2.0 * color - vec3(1.0);
  float map_length = length(mapped);
  mapped = (map_length > 1e-10) ? side * mapped / map_length : point.normal;
  vec3 turned = point.normal + (mapped - point.normal) * max(strength, 0.0);
  float length_squared = dot(turned, turned);
  normal = (length_squared > 1e-20) ? turned * inversesqrt(length_squared) : point.normal;
}
