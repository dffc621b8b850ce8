// Points on flat lamps of each pixel's own, and their visibility by rays: what points that all pixels share leave out, which
// shine as from no nearer than the root r of light_least.
//
//   1 / d^2 - 1 / r^2  at d < r,  drawn in the lamp's plane in proportion to 1 / d^2 about the foot of the place, up to r
//
// So a place that is a height of r or more above the lamp asks no ray, and none brings more than the logarithm of r / height.
#include "light/sources.glsl"
#include "lib/gbuffer.glsl"
#include "trace/rays.glsl"
#define LOWEST 1e-6  // of r squared: from there on the height above a lamp is rounding

Light own_point(Light light, int number)
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec3 position = surface_position_fetch(pixel).xyz;
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 43u + uint(number)));
  vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
  float height = dot(position - light.centre, light.axis);
  float least = light_least(light);
  float low = max(height * height, LOWEST * least);
  float range = log(max(least / max(low, 1e-30), 1.0));
  float squared = low * exp(u.x * range);
  float across = sqrt(max(squared - low, 0.0));
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(light.axis, tangent, bitangent);
  float turn = 2.0 * PI * u.y;
  light.point = position - height * light.axis + across * (cos(turn) * tangent + sin(turn) * bitangent);
  vec3 offset = light.point - light.centre;
  vec3 half_u = light_u(light);
  vec3 half_v = light_v(light);
  vec2 place = vec2(dot(offset, half_u) / max(dot(half_u, half_u), 1e-30), dot(offset, half_v) / max(dot(half_v, half_v), 1e-30));
  bool there = height > 0.0 && range > 0.0 && light_has_place(light, place);
  // Over the density, and over area / r^2, by which light_sample has it.
  light.radiance *= there ? (1.0 - squared / least) * PI * range * least / max(light.area, 1e-30) : 0.0;
  return light;
}

#include "light/ray_visibility.glsl"
