// How densely the rays of the probes fall on a candidate that was kept (column): rays per m2 per probe (row).
#include "indirect/path.glsl"
#include "indirect/probe.glsl"

void main()
{
  out_density = 0.0;
  ivec2 place = ivec2(gl_FragCoord.xy);
  int number = int(kept_fetch(ivec2(place.x, 0)).x);
  ivec2 candidate = ivec2(number % rays, number / rays);
  vec3 normal = candidate_normal_fetch(candidate).xyz;
  vec3 point = ray_origin(candidate_point_fetch(candidate).xyz, normal);
  Probe probe = probe_read(place.y);
  if (!probe.receives) {
    return;
  }
  vec3 origin = ray_origin(probe.position, probe.geometric_normal);
  vec3 path = point - origin;
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
