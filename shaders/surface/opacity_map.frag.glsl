// How much of a cell is covered, and that it was asked once, for the front and for the back: to be added up.
#include "surface/seen.glsl"

void main()
{
  bool back = instance_flat.y == 1;
  vec3 outward = back ? -world_normal : world_normal;
  vec3 normal = safe_normalize(cross(dFdx(world_position), dFdy(world_position)));
  normal = (dot(normal, outward) < 0.0) ? -normal : normal;
  // Seen from four directions, spread as diffuse light comes.
  float sine_squared = (float(sample_flat) + 0.5) / 4.0;
  float turn = 2.4 * float(sample_flat) + 0.5;
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  vec3 incoming = sqrt(1.0 - sine_squared) * normal
                  + sqrt(sine_squared) * (cos(turn) * tangent + sin(turn) * bitangent);
  bool behind;
  Closures c = closures_seen(incoming, RAY_SHADOW, behind);
  float covered = 1.0 - clamp(dot(c.transparency, vec3(1.0 / 3.0)), 0.0, 1.0);
  covered = is_finite(covered) ? covered : 1.0;
  out_opacity = back ? vec4(0.0, 0.0, covered, 1.0) : vec4(covered, 1.0, 0.0, 0.0);
}
