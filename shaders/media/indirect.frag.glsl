// Light that media scatter after other bounces, and that they bring to surfaces: one walk of up to `bounces` steps for each.
//
// The first walk starts at a place on the view ray, the second at the surface, whose irradiance it finds (of what media
// scatter; light of other surfaces is not its matter). At each step a ray goes on by the phase function or the cosine, to a
// place in media or to a surface, drawn by what media let pass; there one row of lights, drawn evenly, is asked. As on the
// view ray, half of the places in media are drawn around that row's point: near a lamp others would be fireflies.
#include "lib/gbuffer.glsl"
#include "media/arriving.glsl"
#include "media/view_ray.glsl"
#include "media/dither.glsl"

vec3 mean_albedo(ivec2 hit)
{
  int material = int(leaf_texel(hit.x * LEAF_TEXELS + MATERIAL_TEXEL)[hit.y] + 0.5);
  return reflectance_fetch(ivec2(material & 15, material >> 4)).rgb;
}

// Light of row `number` on a surface of albedo 1, as radiance.
Asked ask_surface(int number, vec3 position, vec3 normal, vec2 u)
{
  Asked asked;
#ifdef WORLD_LIT
  if (number >= light_count) {
    asked.direction = cosine_direction(normal, u);
    asked.reach = 1e29;
    asked.shadow = true;
    asked.glass_stops = false;
    float lobe = max(dot(asked.direction, normal), 0.0) / PI;
    float rows = world_rows * environment_density(asked.direction);
    asked.found = environment_radiance(asked.direction) * lobe / max(rows + lobe, 1e-30);
    return asked;
  }
#endif
  Light light = light_read(number);
  float density;
  asked = ask_light(light, position, u, density);
  float lobe = max(dot(normal, asked.direction), 0.0) / PI;
  asked.found *= lobe;
#ifdef WORLD_LIT
  if (LIGHT_IS(light, LIGHT_DIRECTION)) {
    asked.found *= world_rows * density / max(world_rows * density + lobe, 1e-30);
  }
#endif
  return asked;
}

// What a ray brings back that sets out with this weight. `media_only`: a surface that it meets first ends it.
vec3 walk(vec3 position, vec3 direction, vec3 weight, bool media_only, inout uint seed)
{
  vec3 sum = vec3(0.0);
  for (int i = 0; i < bounces; i++) {
    ivec2 hit;
    float limit = trace_nearest(position, direction, 1e29, seed, hit);
    Bins bins = media_bins(position, direction, limit, seed);
    sum += weight * bins.emitted;
    bool in_media = bins.total > 0.0 && bins.count > 0;
    bool at_surface = hit.x >= 0 && !(media_only && i == 0);
    float passing = dot(bins.end, vec3(1.0 / 3.0));
    float chance = !in_media ? 0.0 : (at_surface ? clamp(1.0 - passing, 0.1, 0.9) : 1.0);
    bool scattered = media_random(seed) < chance;
    if (!scattered && !at_surface) {
      break;
    }
    int number = min(int(media_random(seed) * float(ROWS_ASKED)), ROWS_ASKED - 1);
    vec2 ask_turn = vec2(media_random(seed), media_random(seed));
    vec2 turn = vec2(media_random(seed), media_random(seed));
    vec3 next;
    vec3 bounced;
    Asked asked = ask_nothing();
    vec3 onwards = -direction;
    if (scattered) {
      int k;
      float t;
      Around around = around_row(number, ask_turn, position, direction, bins.from[0], bins.to[bins.count - 1]);
      float v = media_random(seed);
      if (around.exists && v < 0.5) {
        t = around_draw(around, 2.0 * v);
        k = bins_find(bins, t);
        if (k < 0) {
          break;  // between media
        }
      }
      else {
        t = bins_draw(bins, around.exists ? 2.0 * v - 1.0 : v, k);
      }
      float density = bins_density(bins, k, t);
      density = around.exists ? 0.5 * (density + around_density(around, t)) : density;
      weight *= bin_passing(bins, k, t) / max(density * chance, 1e-30);
      position += t * direction;
      uint inside = bins.media[k];
      if (number >= 0) {
        asked = ask_scattered(number, inside, position, onwards, ask_turn, seed);
      }
      float g = media_lobe(inside, position, seed);
      next = -phase_direction(g, onwards, turn);
      float lobe = phase_henyey_greenstein(g, dot(-next, onwards));
      bounced = media_scattered(inside, position, -next, onwards, seed) / max(lobe, 1e-30);
    }
    else {
      weight *= bins.end / (1.0 - chance) * mean_albedo(hit);
      vec3 normal = triangle_normal(hit);
      normal = (dot(normal, direction) > 0.0) ? -normal : normal;
      position = ray_origin(position + limit * direction, normal);
      if (number >= 0) {
        asked = ask_surface(number, position, normal, ask_turn);
      }
      next = cosine_direction(normal, turn);
      bounced = vec3(1.0);
    }
    sum += weight * float(ROWS_ASKED) * asked_arriving(asked, position, seed);
    weight *= bounced;
    direction = next;
    // Faint walks end at random (Russian roulette).
    float left = max_component(weight);
    float survives = (i < 2) ? 1.0 : clamp(left, 0.0, 1.0);
    if (!(left > 0.0) || media_random(seed) >= survives) {
      break;
    }
    weight /= survives;
  }
  return sum;
}

vec3 finite_sum(vec3 sum)
{
  return (is_finite(sum.x) && is_finite(sum.y) && is_finite(sum.z)) ? sum : vec3(0.0);
}

void main()
{
  out_indirect = vec4(0.0);
  out_surface = vec4(0.0);
  ivec2 size = surface_position_size();
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * STRIDE + shown_pixel, size - 1);
  vec4 seen = surface_position_fetch(pixel);
  ViewRay ray = view_ray(seen, vec2(pixel) + 0.5);
  uint seed = roll_of(pixel, film_view.sample_index, film_view.seed, 44).x;
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 4711u));
  Bins bins = media_bins(ray.origin, ray.direction, ray.limit, seed);
#if STRIDE > 1
  out_indirect.w = min(ray.limit, 1e18);
  out_surface.w = 1.0 - dot(bins.end, vec3(1.0 / 3.0));
#endif
  vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
  Surface s = SURFACE_READ(pixel);
  // One walk after the other, so that the program holds it once.
  for (int which = 0; which < 2; which++) {
    bool from_surface = which == 1;
    vec3 position = ray.origin;
    vec3 next = vec3(0.0, 0.0, 1.0);
    vec3 weight = vec3(0.0);
    if (!from_surface && bins.total > 0.0 && bins.count > 0) {
      int k;
      float t = bins_draw(bins, shuffled(film_view.sample_index, salt.yz), k);
      position += t * ray.direction;
      float g = media_lobe(bins.media[k], position, seed);
      next = -phase_direction(g, -ray.direction, u);
      float lobe = phase_henyey_greenstein(g, dot(next, ray.direction));
      weight = bin_passing(bins, k, t) / max(bins_density(bins, k, t), 1e-30);
      weight *= media_scattered(bins.media[k], position, -next, -ray.direction, seed) / max(lobe, 1e-30);
    }
    if (from_surface && ray.hit && max_component(s.diffuse) > 0.0) {
      next = cosine_direction(s.normal, u);
      if (dot(next, s.geometric_normal) > 0.0) {
        position = ray_origin(s.position, s.geometric_normal);
        weight = (STRIDE > 1) ? vec3(1.0) : s.diffuse;
      }
    }
    if (max_component(weight) > 0.0) {
      vec3 found = finite_sum(walk(position, next, weight, from_surface, seed));
      if (from_surface) {
        out_surface.rgb = found;
      }
      else {
        out_indirect.rgb = found;
      }
    }
  }
}
