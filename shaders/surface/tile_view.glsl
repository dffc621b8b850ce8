// From where the sample of a tile's cell looks at its triangle: four directions, spread as diffuse light comes.
#include "surface/seen.glsl"

vec3 tile_view(bool back)
{
  vec3 outward = back ? -world_normal : world_normal;
  vec3 normal = safe_normalize(cross(dFdx(world_position), dFdy(world_position)));
  normal = (dot(normal, outward) < 0.0) ? -normal : normal;
  float sine_squared = (float(sample_flat) + 0.5) / 4.0;
  float turn = 2.4 * float(sample_flat) + 0.5;
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  return sqrt(1.0 - sine_squared) * normal + sqrt(sine_squared) * (cos(turn) * tangent + sin(turn) * bitangent);
}
