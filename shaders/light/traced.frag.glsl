// Direct light of narrow glossy lobes: one ray per pixel, drawn from the lobe. What it reaches first, a light or the
// world, counts with the power-heuristic share that light/direct.frag.glsl leaves; what blocks it counts nothing,
// since light from surfaces is indirect.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "lib/environment.glsl"
#include "light/sources.glsl"
#include "trace/own_solid.glsl"
#include "trace/rays.glsl"
#include "ask/media.glsl"
#include "ask/links.glsl"

#define GOLDEN 0.618034

// Share of the lobe's samples against `light_samples` of density `light_density` (power heuristic, beta = 2).
float lobe_share(float lobe_density, float light_density, float light_samples)
{
  float ratio = light_samples * light_density / max(float(CANDIDATES) * lobe_density, 1e-30);
  return 1.0 / (1.0 + ratio * ratio);
}

// Light that arrives along `direction` if nothing nearer than `limit` blocks it, with the shares applied. `span` is how
// far the nearest and the farthest of its sources are. `alone`: light samples find none of it.
vec3 arriving(ivec2 pixel, vec3 origin, vec3 direction, float lobe_density, bool alone, float limit, out vec2 span)
{
  vec3 sum = vec3(0.0);
  span = vec2(1e29, 0.0);
  if (limit >= 1e29 && world_glossy != 0) {
    vec3 radiance = environment_radiance(direction);
    if (world_samples > 0.0 && !alone) {
      radiance *= lobe_share(lobe_density, environment_density(direction), world_samples);
    }
    sum += radiance;
    span.y = (max_component(abs(radiance)) > 0.0) ? 1e29 : 0.0;
  }
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    if ((light.flags & LIGHT_GLOSSY) == 0) {
      continue;
    }
    if (light_leaves_out(light, receiver_group(pixel))) {
      continue;
    }
    float hit_distance;
    float density;
    vec3 radiance = light_hit(light, origin, direction, hit_distance, density);
    if (hit_distance <= limit && max_component(abs(radiance)) > 0.0) {
      sum += radiance * (alone ? 1.0 : lobe_share(lobe_density, density, light.rate));
      span = vec2(min(span.x, hit_distance), max(span.y, min(hit_distance, 1e29)));
    }
  }
  return sum;
}

vec3 start_of_ray(Surface s, vec3 direction, uint layers)
{
  vec3 origin = ray_origin(s.position, side_of_ray(s, direction));
  return enters_itself(s, direction) ? beyond_solid(origin, direction, layers) : origin;
}

// Light that the lobe of a surface finds. `salt`: numbers of the pixel and lobe.
vec3 light_of_lobe(Surface s, ivec2 pixel, uvec3 salt)
{
  if (s.glossy_roughness > traced_roughness || s.kind > FRESNEL_F82) {
    return vec3(0.0);
  }
  vec3 found = vec3(0.0);
  vec3 to_viewer = TO_VIEWER(s);
  Lobe lobe = lobe_begin(s, to_viewer);
  bool mirror = lobe_is_mirror(lobe);
  vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
  float choice = shuffled(film_view.sample_index, salt.zx);  // apart from what chose the lobe

  // Resampled importance sampling (Talbot et al. 2005): candidates of the lobe, one of which is kept in proportion to
  // what it would bring if nothing blocked it. The mean over the candidates is exact; only visibility is sampled.
  int count = mirror ? 1 : CANDIDATES;
  float total = 0.0;
  float kept_importance = 0.0;
  vec2 kept_span = vec2(0.0);
  vec3 kept_direction = vec3(0.0);
  vec3 kept_weight = vec3(0.0);
  float kept_density = 0.0;
  for (int k = 0; k < count; k++) {
    vec3 weight;
    vec2 of_candidate = vec2((u.x + float(k)) / float(count), fract(u.y + GOLDEN * float(k)));  // else all are in the tail at once
    vec3 direction = lobe_sample(lobe, of_candidate, weight);
    if (max_component(weight) <= 0.0 || !may_mirror(s, direction)) {
      continue;
    }
    float density = 0.0;
    if (!mirror) {
      lobe_reflection(lobe, direction, density);
    }
    vec2 span;
    bool alone = mirror || enters_itself(s, direction);
    vec3 light = arriving(pixel, s.position, direction, density, alone, 1e29, span);
    float importance = dot(abs(weight * light), vec3(1.0));
    if (importance > 0.0 && reservoir_takes(importance, total, choice)) {
      kept_importance = importance;
      kept_direction = direction;
      kept_weight = weight;
      kept_density = density;
      kept_span = span;
    }
  }
  uint layers = salt.z + uint(film_view.sample_index);
  ivec2 hit;
  if (kept_importance > 0.0) {
    vec3 origin = start_of_ray(s, kept_direction, layers);
    // Whatever stands before the nearest source blocks all of them.
    // What is behind glass that bends is left to the rays of hits/, where these follow the lobe.
    bool glass_stops = glass_bends != 0 && s.glossy_roughness <= shaded_roughness;
    float blocked = trace_layers(origin, kept_direction, kept_span.y, kept_span.x, layers, glass_stops, false, hit);
    if (blocked >= kept_span.x) {
      vec2 ignored;
      float limit = (blocked < kept_span.y) ? blocked : 1e29;
      bool alone = mirror || enters_itself(s, kept_direction);
      vec3 light = arriving(pixel, s.position, kept_direction, kept_density, alone, limit, ignored);
      found = kept_weight * light * (total / (kept_importance * float(count)));
      float reach = (kept_span.x < 1e28) ? kept_span.x : FARTHEST_MEDIUM;
      found *= media_transmittance(origin, kept_direction, reach, salt.x) * layers_color(reach);
    }
  }
  if (emissive_power > 0.0 && s.glossy_roughness > shaded_roughness) {
    // Emissive triangles are only known once a ray meets them, so they cannot be weighed beforehand: a ray of their own.
    vec3 weight;
    vec3 direction = lobe_sample(lobe, u, weight);
    if (max_component(weight) <= 0.0 || !may_mirror(s, direction)) {
      return found;
    }
    vec3 origin = start_of_ray(s, direction, layers);
    float t = trace_nearest(origin, direction, 1e29, layers, hit);
    weight *= layers_color(t);
    if (t < 1e29) {
      vec3 normal;
      vec3 emission = triangle_emission(hit, direction, normal);
      float share = 1.0;
      if (!mirror && !enters_itself(s, direction) && max_component(abs(emission)) > 0.0) {
        float lobe_density;
        lobe_reflection(lobe, direction, lobe_density);
        // The density of points per area: addon/lighting/emissive_triangles.py.
        float light_density = emissive_density(emission, emissive_level) / emissive_power * t * t
                              / max(abs(dot(normal, direction)), 1e-6);
        float ratio = emissive_points * light_density / max(lobe_density, 1e-30);
        share = 1.0 / (1.0 + ratio * ratio);
      }
      weight *= media_transmittance(origin, direction, t, salt.y);
      found += weight * emission * share;
    }
  }
  return found;
}

void main()
{
  out_diffuse = vec4(0.0);
  out_glossy = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0 || max_component(surface_tint_fetch(pixel).rgb) <= 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  // One call for both lobes: compilers hold the code of each.
  for (int k = 0; k < (s.coated ? 2 : 1); k++) {
    Surface shown = (k == 0) ? surface_mirrored(s) : surface_coat(s);
    out_glossy.rgb += light_of_lobe(shown, pixel, hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 11u + uint(k))));
  }
}
