// Light that arrives at what rays have met and that is sent on along them: of this sample's points on lights, one of which
// is traced, and of virtual lights and near surfaces (indirect/near.glsl). What a lobe sends that a ray follows is left to
// that ray but for its share of the points.
#define PART 128  // virtual lights that a hit looks at
#include "indirect/near.glsl"
#ifdef TRANSMISSION
#include "lib/refraction.glsl"
#endif
#ifdef SOFT_LOBES
#include "lib/soft_lobe.glsl"
#endif
#include "hits/path.glsl"
#include "hits/onward.glsl"

struct Receiver {
  Surface surface;
  vec3 viewer;
  bool shines;     // has a lobe of microfacets that light samples can find
  bool bends;
  bool within;     // glass mirrors, whose rays bend where light samples would pass straight
  bool followed;   // by a ray
  bool turned;     // by an edit where it leaves glass: rays alone find what is there
  bool ended;      // would be, but for the number of bounces: shows nothing
  int group;       // of receivers
  int mirrored;    // by so many surfaces on the way to the camera
  Lobe lobe;
#ifdef TRANSMISSION
  Interface glass;
#endif
};

// Radiance towards the viewer by a source if nothing blocks it.
vec3 reflected_light(Receiver r, Light light, vec3 arriving, vec3 direction, float density)
{
  vec3 sum = vec3(0.0);
  if ((light.flags & LIGHT_DIFFUSE) != 0) {
    sum += surface_diffuse_reflection(r.surface, r.viewer, direction);
  }
  float lobe_density = 0.0;
  vec3 of_lobe = vec3(0.0);
  if (r.shines && (light.flags & LIGHT_GLOSSY) != 0 && dot(direction, r.surface.geometric_normal) > 0.0) {
    of_lobe = lobe_reflection(r.lobe, direction, lobe_density);
  }
#ifdef TRANSMISSION
  // What frosted glass mirrors within is left to rays.
  if (r.bends && (light.flags & LIGHT_TRANSMISSION) != 0 && dot(direction, r.glass.normal) < 0.0) {
    of_lobe = interface_value(r.glass, direction, lobe_density);
  }
#endif
  if (r.followed && density > 0.0) {
    of_lobe *= r.turned ? 0.0 : power_share(light.rate * density, lobe_density);
  }
  sum += of_lobe;
#ifdef SOFT_LOBES
  SoftLobe soft = soft_lobe_begin(r.surface, r.viewer);
  if (soft.exists && (light.flags & (soft.glossy ? LIGHT_GLOSSY : LIGHT_DIFFUSE)) != 0) {
    sum += soft_reflection(soft, direction);
  }
#endif
  return sum * arriving;
}

vec3 direct_light(Receiver r, uint salt)
{
  float total = 0.0;
  float chosen_share = 0.0;
  int chosen = -1;
  vec3 chosen_light = vec3(0.0);
  vec3 chosen_direction = r.surface.normal;
  uint roll = salt;
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
#ifdef HAS_RECEIVER_GROUPS
    if (((light.unlit >> r.group) & 1) != 0) {
      continue;
    }
#endif
    vec3 direction;
    float density;
    vec3 arriving = light_sample(light, r.surface.position, direction, density);
    vec3 reflected = reflected_light(r, light, arriving, direction, density);
    float share = luminance(abs(reflected));
    if (!(share > 0.0) || !is_finite(share)) {
      continue;
    }
    total += share;
    if (draw_passing(share, total, roll)) {
      chosen_share = share;
      chosen = i;
      chosen_light = reflected;
      chosen_direction = direction;
    }
  }
  if (!(total > DARK) || chosen < 0) {
    return vec3(0.0);
  }
  Light light = light_read(chosen);
  vec3 side = r.surface.geometric_normal;
  bool behind = (r.bends || r.surface.kind == LOBE_TRANSLUCENT) && dot(chosen_direction, side) < 0.0;
  vec3 origin = ray_origin(r.surface.position, behind ? -side : side);
#ifdef SOFT_LOBES
  SoftLobe soft = soft_lobe_begin(r.surface, r.viewer);
  if (soft.fibre) {
    vec3 facing;
    vec3 start = fibre_start(soft, r.surface.position, chosen_direction, facing);
    origin = ray_origin(start, facing);
  }
#endif
  float reach = light_reach(light, origin, chosen_direction);
  ivec2 hit;
  bool glass_stops = r.bends || r.within || (light.flags & LIGHT_GLASS_BLOCKS) != 0;
  bool looks = (light.flags & LIGHT_SHADOW) != 0 && reach > 0.0;
  bool blocked = looks && trace_layers(origin, chosen_direction, reach, reach, salt, glass_stops, true, hit) < reach;
  chosen_light *= looks ? layers_color(1e30) : vec3(1.0);
  float through = min(light_distance(light, origin, chosen_direction), FARTHEST_MEDIUM);
  chosen_light *= blocked ? vec3(0.0) : media_transmittance(origin, chosen_direction, through, salt);
  return blocked ? vec3(0.0) : chosen_light * (total / chosen_share);
}

// Light of other surfaces: by virtual lights, and by a short ray for what those leave out.
vec3 indirect_light(Receiver r, uvec3 roll)
{
  vec3 sum = vec3(0.0);
  Reflection reflection = surface_reflection(r.surface, max(dot(r.surface.geometric_normal, r.viewer), 0.0));
  if (r.followed || r.bends || r.ended) {
    reflection.straight = reflection.grazing = vec3(0.0);
  }
  vec3 lit = r.surface.normal;
  vec3 side = r.surface.geometric_normal;
  vec3 position = r.surface.position;
  if (max_component(reflection.through) > 0.0) {
    bool passes = reflects_far_side(reflection, to_unit(hash3(roll).x));
    position -= passes ? max(-reflection.rough, 0.0) * side : vec3(0.0);
    lit = passes ? -lit : lit;
    side = passes ? -side : side;
  }
  if (max_component(reflection.diffuse + reflection.grazing) <= 0.0) {
    return sum;
  }
  vec3 from;
  vec3 arriving = virtual_irradiance(position, lit, glossy_radius, r.mirrored > 0, roll.z, from);
  sum += arriving * reflection_of(reflection, lit, from, r.viewer);
  Walk walk;
  vec3 weight;
  walk.direction = reflection_sample(reflection, lit, r.viewer, vec2(to_unit(roll.x), to_unit(roll.y)), weight);
  if (dot(walk.direction, side) > 0.0 && max_component(weight) > 0.0) {
    walk.origin = ray_origin(position, side);
    walk.bounce = 1;
    walk.whole = false;
  walk.gloss = false;
    walk.has_met = false;
    sum += weight * radiance_along(walk, glossy_radius, hash3(roll));
  }
  return sum;
}

void main()
{
  out_glossy_indirect = vec4(0.0);
#ifdef TRANSMISSION
  out_transmission_indirect = vec4(0.0);
#endif
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 path = met_path_fetch(pixel);
  int code = int(path.w + 0.5);
  if (code == 0 || surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Receiver r;
  r.surface = SURFACE_READ(pixel);
  r.viewer = -ray_direction_fetch(pixel).xyz;
#ifdef HAS_RECEIVER_GROUPS
  r.group = int(receiver_groups_fetch(pixel).x + 0.5);
#endif
  bool has_lobe = max_component(r.surface.glossy_weight) > 0.0;
#ifdef TRANSMISSION
  r.bends = has_lobe && r.surface.kind == LOBE_REFRACTION;
#else
  r.bends = false;
#endif
  r.shines = has_lobe && r.surface.kind <= FRESNEL_F82;
  r.mirrored = path_mirrors(code);
  bool goes_on = lobe_goes_on(r.surface);
  r.within = mirrors_within(r.surface);
  r.followed = has_lobe && goes_on && ray_number + 1 < rays
               && (r.bends ? ray_number < interfaces : r.mirrored < mirrors);
  r.turned = path_is_edited(code) && r.bends && r.surface.glossy_ior <= 1.0;
  r.ended = has_lobe && goes_on && !r.followed;
  r.lobe = lobe_begin(r.surface, r.viewer);
  r.shines = r.shines && !lobe_is_mirror(r.lobe);
#ifdef TRANSMISSION
  r.glass = interface_met(r.surface, r.viewer, r.mirrored < mirrors);
#endif
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 101 + ray_number);
  // Light from below the surface takes the place of what a diffuse one would send.
  vec3 diffuse = r.surface.diffuse;
  vec3 sent;
  vec3 part;
  vec3 same;
  bool leaves = light_leaves(-1, r.surface.position, r.surface.geometric_normal, r.viewer, roll.y, sent, part, same);
  vec3 straight = leaves ? diffuse * (vec3(1.0) - part) : diffuse;
  vec3 onward = leaves ? diffuse * (vec3(1.0) - part * (vec3(1.0) - same)) : diffuse;
  vec3 sum = leaves ? float(repeats) * diffuse * part * sent : vec3(0.0);
  for (int k = 0; k < repeats; k++) {
    r.surface.diffuse = straight;
    sum += direct_light(r, roll.x);
    r.surface.diffuse = onward;
    roll = hash3(roll);
    if (glossy_radius > 0.0 && r.mirrored < bounces) {
      sum += indirect_light(r, roll);
    }
  }
  sum /= float(repeats);
  vec4 light = vec4(path.rgb * hit_passed_fetch(pixel).rgb * sum, 0.0);
  light.rgb = is_finite(max_component(abs(light.rgb))) ? light.rgb : vec3(0.0);
  if (path_is_glossy(code)) {
    out_glossy_indirect = light;
  }
#ifdef TRANSMISSION
  else {
    out_transmission_indirect = light;
  }
#endif
}
