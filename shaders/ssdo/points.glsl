// The thesis's samples: points in a half ball around a surface. A point that what is seen on the screen stands before is
// taken for solid, and what is seen there for its surface (Ritschel, Grosch and Seidel 2009).
#include "ssdo/fan.glsl"

struct Blocker {
  ivec2 texel;
  vec3 position;
  vec3 normal;
  float share;  // 0: the point is open; less than 1 near the border of the half ball
};

// Unit vector, evenly distributed over the hemisphere around a normal.
vec3 hemisphere_direction(vec3 normal, vec2 u)
{
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  float height = 1.0 - u.x;
  float ring = sqrt(max(1.0 - height * height, 0.0));
  float turn = 2.0 * PI * u.y;
  return ring * cos(turn) * tangent + ring * sin(turn) * bitangent + height * normal;
}

// What blocks the point at `share` of the radius. Where the picture knows nothing, nothing does.
Blocker point_blocker(vec3 origin, vec3 direction, float share)
{
  Blocker found;
  found.texel = ivec2(0);
  found.position = origin;
  found.normal = direction;
  found.share = 0.0;
  vec4 point = vec4(origin + direction * (share * farthest), 1.0);
  float w = dot(film_view.row_w, point);
  vec2 size = film_view.film.xy;
  if (w <= 1e-6 * farthest) {
    return found;
  }
  vec2 place = (vec2(dot(film_view.row_x, point), dot(film_view.row_y, point)) / w * 0.5 + 0.5) * size;
  if (any(lessThan(place, vec2(0.0))) || any(greaterThanEqual(place, size))) {
    return found;
  }
  vec4 position = surface_position_fetch(ivec2(place));
  if (position.w == 0.0) {
    return found;
  }
  found.texel = ivec2(place);
  found.position = position.xyz;
  found.normal = octahedral_decode(surface_normal_fetch(found.texel).zw);
  // Depth of the surface's tangent plane on the point's ray, which is not that of the pixel's centre.
  vec3 ray_origin;
  vec3 ray = film_ray(place, ray_origin);
  float depth = view_depth(found.position);
  float slope = dot(found.normal, ray);
  float met = dot(found.normal, found.position - ray_origin) / min(slope, -1e-12);
  bool edge_on = slope > -0.01 * length(ray);
  if (view_depth(point.xyz) > (edge_on ? depth : met) + 2e-3 * farthest) {
    found.share = 1.0 - smoothstep(0.7 * farthest, farthest, distance(found.position, origin));
  }
  return found;
}

// Three numbers of point `index` out of those of its pixel (R3 lattice on the torus).
vec3 point_numbers(vec3 u, int index)
{
  return fract(u + float(index) * vec3(0.8191725134, 0.6710436067, 0.5497004779));
}
