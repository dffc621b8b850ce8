// Light that arrives at what rays have met, straight from this sample's points on lights, and that is sent on along them:
// one point is traced. What a lobe sends that a ray follows is left to that ray but for its share of the points.
#include "hits/receiver.glsl"
#ifdef SOFT_LOBES
#include "lib/soft_lobe.glsl"
#endif

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

// Whether glass stops rays to a light's points: what passes it arrives in another way.
bool stops_at_glass(Receiver r, Light light)
{
  return r.bends || r.within || (light.flags & LIGHT_GLASS_BLOCKS) != 0;
}

// What emissive triangles close by bring that their points leave out; a lobe that a ray follows finds them by that.
vec3 light_close_by(Receiver r, Light light, uint salt)
{
  vec3 side = r.surface.geometric_normal;
  vec3 direction;
  vec3 origin = ray_origin(r.surface.position, side);
  vec3 arriving = emission_close_by(light, origin, r.surface.normal, stops_at_glass(r, light), salt, direction);
  if (max_component(abs(arriving)) <= 0.0 || dot(direction, side) <= 0.0) {
    return vec3(0.0);
  }
  r.shines = r.shines && !r.followed;
  r.bends = false;
  return reflected_light(r, light, arriving * (PI / max(dot(direction, r.surface.normal), 1e-6)), direction, 0.0);
}

// By a point on one of the sources, drawn in proportion to what it brings unblocked. `emissive`: a point on an emissive surface,
// below 0 where there is none or some mesh leaves this receiver unlit.
vec3 light_of_points(Receiver r, uint salt, out int emissive)
{
  emissive = -1;
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
    emissive = (LIGHT_IS(light, LIGHT_SURFACE) && (light.flags & LIGHT_DIFFUSE) != 0) ? i : emissive;
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
#ifdef HAS_RECEIVER_GROUPS
  emissive = (emissive >= 0 && some_mesh_leaves_out(light_read(emissive), r.group)) ? -1 : emissive;
#endif
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
  bool glass_stops = stops_at_glass(r, light);
  bool looks = (light.flags & LIGHT_SHADOW) != 0 && reach > 0.0;
  bool blocked = looks && trace_layers(origin, chosen_direction, reach, reach, salt, glass_stops, true, hit) < reach;
  chosen_light *= looks ? layers_color(reach) : vec3(1.0);
  float through = min(light_distance(light, origin, chosen_direction), FARTHEST_MEDIUM);
  chosen_light *= blocked ? vec3(0.0) : media_transmittance(origin, chosen_direction, through, salt);
  return blocked ? vec3(0.0) : chosen_light * (total / chosen_share);
}

vec3 light_of_turn(Receiver r, uvec3 roll)
{
  int emissive;
  vec3 sum = light_of_points(r, roll.x, emissive);
  // A loop, since a rasteriser in software skips loops that no pixel enters, but no branches.
  for (; emissive >= 0; emissive = -1) {
    sum += light_close_by(r, light_read(emissive), roll.x);
  }
  return sum;
}

#include "hits/in_turns.glsl"
