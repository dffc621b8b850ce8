// How densely the rays of a probe (row) fall on a candidate (column): rays per m2 there.
#include "indirect/path.glsl"
#include "indirect/probe.glsl"

void main()
{
  out_density = 0.0;
  ivec2 place = ivec2(gl_FragCoord.xy);
  ivec2 candidate = ivec2(place.x % rays, place.x / rays);
  vec4 point = texelFetch(candidate_point, candidate, 0);
  Probe probe = probe_read(place.y);
  if (point.w == 0.0 || !probe.receives) {
    return;
  }
  vec3 normal = texelFetch(candidate_normal, candidate, 0).xyz;
  vec3 origin = ray_origin(probe.position, probe.geometric_normal);
  vec3 path = ray_origin(point.xyz, normal) - origin;
  float squared = max(dot(path, path), 1e-30);
  vec3 direction = path * inversesqrt(squared);
  float cosines = max(dot(probe.normal, direction), 0.0) * max(-dot(normal, direction), 0.0);
  if (cosines <= 0.0 || dot(direction, probe.geometric_normal) <= 0.0) {
    return;
  }
  float visible = 1.0;
  if (candidate.y != place.y) {  // a probe sees what its own rays have met
    uvec3 roll = hash3(uvec3(uint(place.x), uint(place.y), uint(film_view.sample_index)));
    visible = clear_path(origin, direction, sqrt(squared), roll.x);
  }
  out_density = visible * float(rays) * cosines / (PI * squared);
}
