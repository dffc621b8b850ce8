// Half balls as discs (stereographic: angles are kept, circles stay circles), and what a texel of such a map holds: the
// plane of what is nearest, as its distance from the map's point and its unit normal away from there, in the frame
// whose z is the map's axis. Distance 0: nothing. Maps stand side by side in one image, `map_columns` in a row.
// Maps of directions are squares, `parallel` metres to each side of the map's point, whose texels look along the axis; to
// distances BIAS times as much is added there, since planes may lie on either side of the point.
#include "lib/math.glsl"

#define BIAS 64.0

struct Plane {
  float distance;
  vec3 normal;
  bool whole;  // a triangle that stands for itself: what lies beside it is no hole
};

vec2 disc_point(vec3 direction)
{
  return direction.xy / (1.0 + direction.z);
}

vec3 disc_direction(vec2 point)
{
  float squared = dot(point, point);
  return vec3(2.0 * point, 1.0 - squared) / (1.0 + squared);
}

struct TexelRay {
  vec3 start;
  vec3 direction;
};

// Through the middle of a texel of a map with `side` texels; `parallel` 0: of a half ball.
TexelRay texel_ray(ivec2 texel, int side, float parallel)
{
  vec2 point = (vec2(texel) + 0.5) * (2.0 / float(side)) - 1.0;
  TexelRay ray;
  ray.start = vec3(max(parallel, 0.0) * point, 0.0);
  ray.direction = (parallel > 0.0) ? vec3(0.0, 0.0, 1.0) : disc_direction(point);
  return ray;
}

// From the frame of a map with this axis to world space; its transpose is its inverse: v * frame goes back.
mat3 map_frame(vec3 axis)
{
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(axis, tangent, bitangent);
  return mat3(tangent, bitangent, axis);
}

vec2 plane_pack(Plane plane)
{
  float normal = pack_normal(plane.normal);
  return vec2(plane.distance, plane.whole ? -1.0 - normal : normal);
}

Plane plane_unpack(vec2 texel)
{
  Plane plane;
  plane.distance = texel.x;
  plane.whole = texel.y < 0.0;
  plane.normal = unpack_normal(plane.whole ? -1.0 - texel.y : texel.y);
  return plane;
}

// How far along a ray the plane lies; 1e30 where it is not met.
float plane_along(Plane plane, TexelRay ray, float parallel)
{
  float facing = dot(plane.normal, ray.direction);
  float away = plane.distance - BIAS * parallel - dot(plane.normal, ray.start);
  return (plane.distance > 0.0 && facing > 1e-6) ? away / facing : 1e30;
}
