// Light of other surfaces that arrives at what rays have met and is sent on along them: of virtual lights and near surfaces
// (indirect/near.glsl). A program beside received.frag.glsl, since a driver compiles each while a viewport waits.
#define LIT_BY_MAPS
#define BOUNCED
#define PART 128  // virtual lights that a hit looks at
#include "indirect/near.glsl"
#include "hits/receiver.glsl"

// By virtual lights, and by a short ray for what those leave out.
vec3 light_of_turn(Receiver r, uvec3 roll)
{
  vec3 sum = vec3(0.0);
  Reflection reflection = surface_reflection(r.surface, max(dot(r.surface.geometric_normal, r.viewer), 0.0));
  if (r.followed || r.bends || r.ended) {
    reflection.straight = reflection.grazing = vec3(0.0);
  }
  vec3 lit = r.surface.normal;
  vec3 side = r.surface.geometric_normal;
  vec3 position = r.surface.position;
  bool passes = false;
  if (max_component(reflection.through) > 0.0) {
    passes = reflects_far_side(reflection, to_unit(hash3(roll).x));
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
#ifdef MIRRORS_OWNED
  mapped_position = position;
  mapped_normal = (passes || reflection.rough < 0.0) ? vec3(0.0) : side;  // maps bring nothing to far sides and fibres
#endif
  walk.direction = reflection_sample(reflection, lit, r.viewer, vec2(to_unit(roll.x), to_unit(roll.y)), weight);
  if (dot(walk.direction, side) > 0.0 && max_component(weight) > 0.0) {
    walk.origin = ray_origin(position, side);
    walk.bounce = 1;
    walk.whole = false;
    walk.gloss = walk.soft = false;
    walk.in_glass = r.in_glass;
    walk.has_met = false;
    sum += weight * radiance_along(walk, glossy_radius, hash3(roll));
  }
  return sum;
}

#include "hits/in_turns.glsl"
