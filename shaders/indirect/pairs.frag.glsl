// How densely the directions that one candidate of a group draws (row) fall on the next surface of another (column): per m2.
#include "indirect/path.glsl"
#include "indirect/direction_density.glsl"

void main()
{
  out_density = 0.0;
  ivec2 place = ivec2(gl_FragCoord.xy);
  int second = place.y / GROUP * GROUP + place.x;
  int own = int(sorted_order_fetch(ivec2(place.y % LIST_COLUMNS, place.y / LIST_COLUMNS)).x);
  int other = int(sorted_order_fetch(ivec2(second % LIST_COLUMNS, second / LIST_COLUMNS)).x);
  if (own >= candidate_count || other >= candidate_count) {
    return;
  }
  ivec2 from = ivec2(own % rays, own / rays);
  ivec2 to = ivec2(other % rays, other / rays);
  vec4 next = next_point_fetch(to);
  if (next.w == 0.0) {
    return;
  }
  vec4 point = candidate_point_fetch(from);
  if (point.w == 0.0) {
    return;
  }
  vec3 normal = candidate_normal_fetch(from).xyz * point.w;  // on the side from which light reaches it
  vec2 flat_part = vec2(candidate_normal_fetch(to).w, next_radiance_fetch(to).w);
  vec3 next_normal = vec3(flat_part, next.w * sqrt(max(1.0 - dot(flat_part, flat_part), 0.0)));
  vec3 origin = ray_origin(point.xyz, normal);
  uvec3 salt = uvec3(uint(own), uint(other), uint(film_view.sample_index));
  out_density = direction_density(origin, normal, normal, next.xyz, next_normal, own == other, salt);
}
