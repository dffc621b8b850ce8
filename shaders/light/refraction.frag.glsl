// Light that arrives through glass: a walk over interfaces, from the pixel's own through those of solids behind it, to
// a light, the world or a surface. At each interface the lights of this sample are asked directly (one traced), and the
// walk goes on by the interface's lobe; what both can find is weighted by the power heuristic.
//
// Where rays that meet surfaces are followed by themselves (hits/), FIRST_ALONE is defined: what light of lamps
// and the world the first interface lets arrive is all that is left to do here.
//
// What the first interface lets arrive is direct; all else is indirect, as in Cycles' passes.
// Leaves out links: in media and through glass light reaches every receiver.
#include "ask/view.glsl"
#include "lib/refraction.glsl"
#include "light/sources.glsl"
#include "trace/rays.glsl"
#include "trace/glass_color.glsl"
#ifdef ABSORBING
vec3 solid_absorbs(int material)
{
  return interface_table_fetch(ivec2(2, material)).rgb;
}
#include "trace/solid.glsl"
#endif
#include "ask/media.glsl"
#ifndef FIRST_ALONE
#define PART 256  // virtual lights that a surface behind glass looks at: no filter spreads their noise
#include "indirect/near.glsl"
#endif
#include "lib/environment.glsl"
#ifdef HAS_FROZEN_EYES
#include "edit/frozen.glsl"
#endif

// Share of a technique of density `density` against another one of density `other`.
float power_share(float density, float other)
{
  float ratio = other / max(density, 1e-30);
  return 1.0 / (1.0 + ratio * ratio);
}

// Light from this sample's points through an interface; one of them is traced, drawn by what it would bring.
vec3 light_through(Interface surface, vec3 position, vec3 geometric_normal, float choice, uint salt)
{
  float total = 0.0;
  float kept_importance = 0.0;
  int kept = -1;
  vec3 kept_direction = vec3(0.0);
  vec3 kept_light = vec3(0.0);
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    if ((light.flags & LIGHT_TRANSMISSION) == 0) {
      continue;
    }
    vec3 direction;
    float density;
    vec3 light_arriving = light_sample(light, position, direction, density);
    float lobe_density;
    light_arriving *= interface_value(surface, direction, lobe_density);
#ifdef HAS_FROZEN_EYES
    light_arriving *= ((dot(direction, surface.normal) < 0.0) == (dot(direction, geometric_normal) < 0.0)) ? 1.0 : 0.0;
#endif
    if (density > 0.0) {
      light_arriving *= power_share(light.rate * density, lobe_density);
    }
    float importance = dot(abs(light_arriving), vec3(1.0));
    if (importance > 0.0 && is_finite(importance) && reservoir_takes(importance, total, choice)) {
      kept = i;
      kept_importance = importance;
      kept_direction = direction;
      kept_light = light_arriving;
    }
  }
  if (kept < 0) {
    return vec3(0.0);
  }
  Light light = light_read(kept);
  vec3 side = (dot(kept_direction, geometric_normal) < 0.0) ? -geometric_normal : geometric_normal;
  vec3 origin = ray_origin(position, side);
#ifdef FIRST_ALONE
  float reach = light_distance(light, origin, kept_direction) * 0.9999;
#else
  float reach = light_reach(light, origin, kept_direction);
#endif
  ivec2 hit;
  bool blocked = (light.flags & LIGHT_SHADOW) != 0 && reach > 0.0
                 && trace_layers(origin, kept_direction, reach, reach, salt, true, true, hit) < reach;
  float through = min(light_distance(light, origin, kept_direction), FARTHEST_MEDIUM);
  kept_light *= blocked ? vec3(0.0) : layers_color(reach) * media_transmittance(origin, kept_direction, through, salt);
  return blocked ? vec3(0.0) : kept_light * (total / kept_importance);
}

// What a ray of the walk finds before `limit` in lights and world. `lobe_density` 0: only the walk can find it.
vec3 light_found(vec3 origin, vec3 direction, float lobe_density, float limit, bool with_world, uint salt)
{
  vec3 sum = vec3(0.0);
  float nearest = 1e29;  // of the lamps that are seen, which outshine what is behind them
  if (limit >= 1e29 && with_world) {
    vec3 radiance = environment_radiance(direction);
    if (lobe_density > 0.0) {
      radiance *= power_share(lobe_density, world_samples * environment_density(direction));
    }
    sum += radiance;
  }
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    float hit_distance;
    float density;
    vec3 radiance = light_hit(light, origin, direction, hit_distance, density);
    if (hit_distance <= limit && (light.flags & LIGHT_TRANSMISSION) != 0) {
      sum += radiance * ((lobe_density > 0.0) ? power_share(lobe_density, light.rate * density) : 1.0);
      nearest = (max_component(abs(radiance)) > 0.0) ? min(nearest, hit_distance) : nearest;
    }
  }
  if (max_component(abs(sum)) > 0.0) {
    sum *= media_transmittance(origin, direction, min(nearest, FARTHEST_MEDIUM), salt);
  }
  return sum;
}

#ifndef FIRST_ALONE
// What a surface behind glass reflects: exactly where it stands behind the glass in the picture, too, else the mean of its
// material. `behind` holds places and reflectances of all that is not transparent.
vec3 albedo_behind(ivec2 hit, vec3 position, vec3 normal)
{
  ivec2 pixel;
  float slant;
  float footprint;
  if (pixel_of(position, normal, pixel, slant, footprint)) {
    vec4 seen = behind_position_fetch(pixel);
    if (seen.w != 0.0 && distance(seen.xyz, position) < footprint) {
      return behind_albedo_fetch(pixel).rgb;
    }
  }
  return mean_albedo(hit);
}
#endif

void main()
{
  out_direct = vec4(0.0);
  out_indirect = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0 || max_component(surface_tint_fetch(pixel).rgb) <= 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  if (s.kind != LOBE_REFRACTION) {
    return;
  }
  vec3 to_viewer = TO_VIEWER(s);
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 53u));
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 13);
  vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
  float choice = shuffled(film_view.sample_index, salt.zx);
  Interface surface = interface_begin(s.glossy_normal, to_viewer, s.glossy_roughness, s.glossy_ior, s.glossy_tint,
                                      s.glossy_edge.x > 0.5, s.glossy_weight, vec3(0.0));
  surface = interface_edited(surface, s);
#ifdef HAS_FROZEN_EYES
  if (edits_what_leaves(s) && s.glossy_ior > 1.0) {
    vec4 turn = entering_turn(s, surface_edit_fetch(pixel), to_viewer);
    surface.tangent = quaternion_turned(turn, surface.tangent);
    surface.bitangent = quaternion_turned(turn, surface.bitangent);
    surface.normal = quaternion_turned(turn, surface.normal);
  }
#endif
  vec3 position = s.position;
  vec3 geometric_normal = s.geometric_normal;
  vec3 throughput = vec3(1.0);
  // With a transparent film, and glass that is said to be, the picture has a hole where clear glass shows the world: the
  // alpha channels hold how large.
  bool clear = s.glossy_roughness <= clear_roughness;
#ifdef HAS_SURFACE_EDIT
  bool edited = edits_what_leaves(s);
#endif
  for (int step = 0; step <= interfaces; step++) {
    vec3 gained = throughput * light_through(surface, position, geometric_normal, choice, roll.x);
    vec3 weight;
    vec3 direction = interface_sample(surface, u, (step == 0) ? 1.0 : choice, weight);
    float lobe_density;
    interface_value(surface, direction, lobe_density);
    // Interpolated normals and triangle may differ on which side a direction leaves.
    bool passes = dot(direction, surface.normal) < 0.0;
    float side = dot(direction, geometric_normal);
    throughput *= (passes == (side < 0.0) || (step == 0 && surface_is_edited(s))) ? weight : vec3(0.0);
#ifdef HAS_SURFACE_EDIT
    if (edited && passes && surface.ior <= 1.0) {  // what leaves an edited object goes where the edit turns it
      direction = quaternion_turned(s.edit, direction);
      edited = false;
    }
#endif
    clear = clear && passes;
    float hole = 0.0;
    float t = 1e29;
    ivec2 hit;
    vec3 origin = ray_origin(position, passes ? -geometric_normal : geometric_normal);
    bool goes_on = max_component(throughput) > 1e-4;
    vec3 normal = vec3(0.0);
    if (goes_on) {
      t = trace_layers(origin, direction, 1e29, 0.0, roll.y, true, false, hit);
      throughput *= layers_color(t);
      gained += throughput * light_found(origin, direction, lobe_density, t, world_transmission != 0 && !clear, roll.z);
      hole = (clear && t >= 1e29) ? dot(throughput, vec3(1.0 / 3.0)) : 0.0;
      goes_on = t < 1e29;
    }
#ifndef FIRST_ALONE
    if (goes_on) {
      vec3 emission = triangle_emission(hit, direction, normal);
      float light_density = emissive_density(emission, emissive_level) * t * t
                            / max(emissive_power * abs(dot(normal, direction)), 1e-30);
      gained += throughput * emission
                * ((lobe_density > 0.0) ? power_share(lobe_density, emissive_points * light_density) : 1.0);
    }
#endif
    if (step == 0) {
      out_direct += vec4(gained, hole);
    }
    else {
      out_indirect += vec4(gained, hole);
    }
    if (!goes_on) {
      break;
    }

#ifdef FIRST_ALONE
    break;
#else
    position = origin + t * direction;
    roll = hash3(roll + uvec3(uint(step), 0u, 0u));
    int material = triangle_material(hit);
    vec4 glass = interface_table_fetch(ivec2(0, material));
    vec4 shape = interface_table_fetch(ivec2(1, material));
    vec3 smooth_normal = triangle_shading_normal(hit, position);
    normal = (dot(normal, smooth_normal) < 0.0) ? -normal : normal;  // out of the solid
    bool leaves = dot(normal, direction) > 0.0;
    geometric_normal = leaves ? -normal : normal;
#ifdef ABSORBING
    throughput *= exp(-t * solid_absorption(origin, direction, t, hit, leaves, ray_offset(origin), roll.y));
#endif
    if (to_unit(roll.x) >= shape.y) {
      Walk rest;
      rest.direction = direction;
      rest.bounce = 0;
      rest.whole = false;
      rest.gloss = rest.soft = false;
      rest.in_glass = false;
      rest.has_met = true;
      rest.met.position = rest.origin = position;
      rest.met.normal = rest.met.lit = rest.met.turned = geometric_normal;
      rest.met.upright = 1.0;
#ifdef HIT_LINKS
      rest.met.group = triangle_links(hit).x;
#endif
      rest.met.leaving = vec3(0.0);
      rest.met.straight = vec3(1.0);
      rest.met.in_glass = false;
      rest.met.reflection.diffuse = albedo_behind(hit, position, geometric_normal);
      rest.met.reflection.rough = 0.0;
      rest.met.reflection.through = vec3(0.0);
      rest.met.reflection.straight = vec3(0.0);
      rest.met.reflection.grazing = vec3(0.0);
      rest.met.reflection.alpha = 1.0;
#ifdef MIRRORS_OWNED
      rest.met.photons = false;
      rest.met.others = 1.0;
      rest.met.glass = false;
#endif
#ifdef SMOOTH_MIRRORS
      rest.met.mirror_alpha = -1.0;
#endif
#ifdef GLASS_MIRRORS
      rest.met.within = false;
      rest.met.by_rays = 0.0;
#endif
      out_indirect.rgb += throughput * radiance_along(rest, glossy_radius, roll);
      break;
    }
    smooth_normal = leaves ? -smooth_normal : smooth_normal;
    smooth_normal = (dot(smooth_normal, direction) < 0.0) ? smooth_normal : geometric_normal;
    float ior = leaves ? 1.0 / glass.w : glass.w;
    clear = clear && shape.x <= clear_roughness;
    glass.rgb = glass_color(hit, position, glass.rgb, glass.w, shape.y, shape.z > 0.5);
    vec3 scale = vec3(1.0);
    if (shape.z > 1.5) {
      scale = glass_multiscatter(glass.rgb, -dot(smooth_normal, direction), shape.x, ior);
    }
    surface = interface_begin(smooth_normal, -direction, shape.x, ior, vec3(dielectric_f0(ior)), shape.z > 0.5,
                              scale * glass.rgb, scale * ((shape.w > 0.5) ? glass.rgb : vec3(1.0)));
    roll = hash3(roll);
    u = vec2(to_unit(roll.x), to_unit(roll.y));
    choice = to_unit(roll.z);
    roll = hash3(roll);
#endif
  }
}
