// Candidates for virtual lights: points that light the picture, found from the picture. A pixel's cosine-distributed ray
// meets a surface; what that reflects, after up to `bounces` reflections, is estimated by a path on from there.
#include "indirect/path.glsl"
#include "indirect/probe.glsl"

void main()
{
  out_point = vec4(0.0);
  out_normal = vec4(0.0);
  out_radiance = vec4(0.0);
  out_shorter = vec4(0.0);
  ivec2 place = ivec2(gl_FragCoord.xy);
  Probe probe = probe_read(place.y);
  if (!probe.receives) {
    return;
  }
  uint salt = uint(place.x + place.y * 977);
  uvec3 bits = hash3(uvec3(salt, 23u, uint(film_view.seed)));
  // The probe's rays fill strata of the first number, and over the samples a net in both.
  vec2 u = vec2((float(place.x) + scrambled(film_view.bits_x, bits.x)) / float(rays), scrambled(film_view.bits_y, bits.y));
  vec3 direction = cosine_direction(probe.normal, u);
  if (dot(direction, probe.geometric_normal) <= 0.0) {
    return;
  }
  Vertex met;
  float t;
  uvec3 roll = hash3(uvec3(salt, uint(film_view.sample_index), uint(film_view.seed)));
  if (!trace_vertex(ray_origin(probe.position, probe.geometric_normal), direction, 1e29, roll.z, met, t)) {
    return;
  }
  out_point = vec4(met.position, 1.0);
  out_normal = vec4(met.normal, t);
  vec3 throughput = vec3(1.0);
  vec3 radiance = direct_reflected(met, -direction, 4, roll.x);
  vec3 shorter = (bounces > 1) ? radiance : vec3(0.0);
  for (int bounce = 2; bounce <= bounces && max_component(throughput) > 1e-4; bounce++) {
    roll = hash3(roll);
    vec3 onward = cosine_direction(met.normal, vec2(to_unit(roll.x), to_unit(roll.y)));
    throughput *= PI * reflection_of(met.reflection, met.normal, onward, -direction);
    direction = onward;
    if (!trace_vertex(ray_origin(met.position, met.normal), direction, 1e29, roll.z, met, t)) {
      break;
    }
    roll = hash3(roll);
    radiance += throughput * direct_reflected(met, -direction, 1, roll.x);
    shorter = (bounce < bounces) ? radiance : shorter;
  }
  out_radiance = vec4(radiance, 0.0);
  out_shorter = vec4(shorter, 0.0);
}
