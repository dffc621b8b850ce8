// How densely the rays of the probes fall on a candidate that was kept (column): rays per m2 per probe (row).
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "trace/rays.glsl"
#include "indirect/direction_density.glsl"
#include "indirect/probe.glsl"

void main()
{
  out_density = 0.0;
  ivec2 place = ivec2(gl_FragCoord.xy);
  vec4 slot = slots_fetch(ivec2(place.x, 0));
  if (slot.w == 0.0) {
    return;
  }
  int number = int(slot.y);
  ivec2 candidate = ivec2(number % rays, number / rays);
  Probe probe = probe_read(place.y);
  if (!probe.receives) {
    return;
  }
  bool known = candidate.y == place.y;  // a probe sees what its own rays have met
  vec3 origin = ray_origin(probe.position, probe.geometric_normal);
  uvec3 salt = uvec3(uint(place.x), uint(place.y), uint(film_view.sample_index));
  out_density = float(rays) * direction_density(origin, probe.normal, probe.geometric_normal,
                                                candidate_point_fetch(candidate).xyz,
                                                candidate_normal_fetch(candidate).xyz, known, salt);
}
