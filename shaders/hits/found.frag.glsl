// Light that rays find by themselves: emission of what they met, and, behind the first surface, lamps and the world. The
// first surface's own lamps and world are left to light/traced.frag.glsl and light/refraction.frag.glsl.
// Leaves out media: MediaService.fade (addon/lighting/media.py) dims what is found before and behind.
// Leaves out links: light that comes by way of surfaces reaches every receiver.
#include "lib/random.glsl"
#include "lib/environment.glsl"
#include "light/sources.glsl"
#define DIRECT_PATHS
#include "hits/shown.glsl"

// Of what a ray finds. `lobe_density` 0: only rays can find it; FOUND_ELSEWHERE: light samples have all of it.
float share_of_ray(float lobe_density, float light_density)
{
  if (lobe_density == 0.0) {
    return 1.0;
  }
  return (lobe_density > 0.0) ? power_share(lobe_density, light_density) : 0.0;
}

// How much thinner samples of the last lobe's lights lie at the end of a ray than those of where it starts, behind glass.
float thinned(float travelled, float further)
{
  float ratio = 1.0 + travelled / max(further, 1e-30);
  return (travelled > 0.0) ? ratio * ratio : 1.0;
}

// What a ray finds before `limit` in lights and the world. `beyond`: by way of glass that a lobe's ray has met, where samples
// of lamps do not reach that glass blocks, nor (`glass_blocks`) points on emissive meshes, where x is 1, and directions of
// the world of more luminance than y. `photons`: that arrives as photons.
vec3 light_found(vec3 origin, vec3 direction, bool bent, bool beyond, bool photons, float lobe_density, float travelled,
                 float limit, bool with_world)
{
  float alone = photons ? 0.0 : 1.0;  // share of rays where samples do not reach
  vec3 sum = vec3(0.0);
  if (with_world && limit >= 1e29 && (bent ? world_transmission : world_glossy) != 0) {
    vec3 radiance = environment_radiance(direction);
    bool asked = !beyond || luminance(radiance) <= glass_blocks.y;
    sum += radiance * (asked ? share_of_ray(lobe_density, world_samples * environment_density(direction)) : alone);
  }
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    float hit_distance;
    float density;
    vec3 radiance = light_hit(light, origin, direction, hit_distance, density);
    if (hit_distance <= limit && (light.flags & (bent ? LIGHT_TRANSMISSION : LIGHT_GLOSSY)) != 0) {
      bool asked = !beyond || (light.flags & LIGHT_GLASS_BLOCKS) == 0;
      sum += radiance * (asked ? share_of_ray(lobe_density, light.rate * density * thinned(travelled, hit_distance)) : alone);
    }
  }
  return sum;
}

void main()
{
  show_nothing();
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 path = met_path_fetch(pixel);
  int code = int(path.w + 0.5);
  if (code == 0) {
    return;
  }
  vec3 start = ray_origin_fetch(pixel).xyz;
  vec4 along = ray_direction_fetch(pixel);
  vec4 met = surface_position_fetch(pixel);
  vec4 passed = hit_passed_fetch(pixel);
  float limit = (met.w != 0.0) ? dot(met.xyz - start, along.xyz) : 1e29;
  bool glossy = path_is_glossy(code);
  float travelled = ray_travelled_fetch(pixel).x;
  vec3 sum = vec3(0.0);
  // A transparent film has a hole where clear glass shows the world: in alpha, how large.
  bool hole = ray_number > 0 && met.w == 0.0 && path_is_clear(code);
  // Frosted glass has asked for lights itself, and has a density of its own.
  bool behind = path_is_bent(code) && path_mirrors(code) > 0 && travelled > 0.0;
  bool photons = path_has_photons(code) && ray_number > 0 && (behind || (!path_is_bent(code) && along.w == 0.0));
  bool beyond = behind || photons;
  if (ray_number > 0) {
    sum += light_found(start, along.xyz, path_is_bent(code), beyond, photons, along.w, travelled, limit, !hole);
  }
  if (met.w != 0.0 && along.w >= 0.0) {
    vec2 others = (ray_number > 0 || !glossy) ? emissive.zw : emissive.xy;  // power, and points in a sample
    vec3 emission = surface_emission_fetch(pixel).rgb;
    float points = others.y * passed.w / max(others.x, 1e-30) * thinned(travelled, limit);
    bool asked = others.x > 0.0 && !(beyond && glass_blocks.x > 0.0);
    float share = (along.w > 0.0 && asked) ? power_share(along.w, points) : 1.0;
    sum += emission * share;
  }
  vec4 light = vec4(path.rgb * passed.rgb * sum, hole ? dot(path.rgb, vec3(1.0 / 3.0)) : 0.0);
  light.rgb = is_finite(max_component(abs(light.rgb))) ? light.rgb : vec3(0.0);
  show_light(code, (ray_number > 0) ? vec4(0.0) : light, (ray_number > 0) ? light : vec4(0.0));
}
