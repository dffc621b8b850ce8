// Direct light of narrow glossy lobes: one ray per pixel, drawn from the lobe. What it reaches first, a light or the
// world, counts with the power-heuristic share that light/direct.frag.glsl leaves; what blocks it counts nothing,
// since light from surfaces is indirect.
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "lib/environment.glsl"
#include "light/sources.glsl"
#include "trace/hierarchy.glsl"

float power_share(float own, float other)
{
  float ratio = other / max(own, 1e-30);
  return 1.0 / (1.0 + ratio * ratio);
}

void main()
{
  out_diffuse = vec4(0.0);
  out_glossy = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (texelFetch(surface_position, pixel, 0).w == 0.0 || texelFetch(surface_tint, pixel, 0).w <= 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  if (s.glossy_roughness >= traced_roughness) {
    return;
  }
  vec3 to_viewer = (film_view.eye.w > 0.5) ? film_view.backward.xyz : safe_normalize(film_view.eye.xyz - s.position);
  Lobe lobe = lobe_begin(s.glossy_normal, s.tangent_angle, lobe_alpha(s.glossy_roughness, s.glossy_anisotropy),
                         s.glossy_weight, s.fresnel, s.glossy_tint, s.glossy_edge, s.glossy_ior, to_viewer);
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 11u));
  vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
  vec3 weight;
  vec3 direction = lobe_sample(lobe, u, weight);
  if (max_component(weight) <= 0.0 || dot(direction, s.geometric_normal) <= 0.0) {
    return;
  }
  float lobe_density = 0.0;
  bool mirror = lobe_is_mirror(lobe);
  if (!mirror) {
    lobe_reflection(lobe, direction, lobe_density);
  }
  // Away from the surface by what float32 positions of this size cannot tell apart.
  vec3 origin = s.position + s.geometric_normal * max(offset_size, 2e-5 * length(s.position - film_view.eye.xyz));
  float blocked = trace_nearest(origin, direction, 1e29, salt.z + uint(film_view.sample_index));
  vec3 sum = vec3(0.0);
  if (blocked >= 1e29 && world_glossy != 0) {
    float share = 1.0;
    if (world_sampled != 0 && !mirror) {
      share = power_share(lobe_density, environment_density(direction));
    }
    sum += environment_radiance(direction) * share;
  }
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    if ((light.flags & LIGHT_GLOSSY) == 0) {
      continue;
    }
    float hit_distance;
    float density;
    vec3 radiance = light_hit(light, s.position, direction, hit_distance, density);
    if (hit_distance <= blocked) {
      sum += radiance * (mirror ? 1.0 : power_share(lobe_density, density));
    }
  }
  out_glossy = vec4(weight * sum, 0.0);
}
