// How densely the directions that one candidate of a group draws (row) fall on the next surface of another (column): per m2.
#include "indirect/path.glsl"

void main()
{
  out_density = 0.0;
  ivec2 place = ivec2(gl_FragCoord.xy);
  int group = place.y / GROUP;
  int own = int(grouped_fetch(ivec2(place.y % GROUP, group)).x);
  int other = int(grouped_fetch(ivec2(place.x, group)).x);
  if (own < 0 || other < 0) {
    return;
  }
  ivec2 from = ivec2(own % rays, own / rays);
  ivec2 to = ivec2(other % rays, other / rays);
  vec4 next = next_point_fetch(to);
  if (next.w == 0.0) {
    return;
  }
  vec3 normal = candidate_normal_fetch(from).xyz;
  vec2 flat_part = vec2(candidate_normal_fetch(to).w, next_radiance_fetch(to).w);
  vec3 next_normal = vec3(flat_part, next.w * sqrt(max(1.0 - dot(flat_part, flat_part), 0.0)));
  vec3 origin = ray_origin(candidate_point_fetch(from).xyz, normal);
  vec3 path = ray_origin(next.xyz, next_normal) - origin;
  float squared = max(dot(path, path), 1e-30);
  vec3 direction = path * inversesqrt(squared);
  float cosines = max(dot(normal, direction), 0.0) * max(-dot(next_normal, direction), 0.0);
  if (cosines <= 0.0) {
    return;
  }
  float visible = 1.0;
  if (own != other) {  // a path has met its own
    uvec3 roll = hash3(uvec3(uint(own), uint(other), uint(film_view.sample_index)));
    visible = clear_path(origin, direction, sqrt(squared), roll.x);
  }
  out_density = visible * cosines / (PI * squared);
}
