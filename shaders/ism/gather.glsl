// Virtual lights and their maps: every one brings what its map says, and a few rays correct that in the mean. Of those
// that are shown one is drawn and taken off if a ray finds it hidden, of those that are not one is added if it is seen.
#include "indirect/lights.glsl"
#include "ism/paraboloid.glsl"

#define SLACK 0.005  // of the distance, about the error of stored normals and of flat triangles on curved things

// Whether a place of a surface is seen by a virtual light, all in the frame of its map: not behind the plane of what the
// map shows there, unless that is the surface itself beside the place, bent away. On an arc the angle between two normals
// is that by which the chord leaves the tangent, twice.
float texel_visibility(ivec2 tile, ivec2 texel, vec3 place, vec3 normal, float slack)
{
  Plane blocker = plane_unpack(virtual_maps_fetch(tile + texel).xy);
  float behind = dot(place, blocker.normal) - blocker.distance;
  if (blocker.distance <= 0.0 || behind <= slack) {
    return 1.0;
  }
  float alike = -dot(normal, blocker.normal);
  vec3 direction = texel_direction(texel, map_side);
  float apart = length(direction * min(plane_along(blocker, direction), 1e15) - place);
  return (alike > 0.5 && behind < 0.75 * apart * sqrt(max(1.0 - alike * alike, 0.0)) + slack) ? 1.0 : 0.0;
}

// The share of a virtual light that a surface sees: bilinear between what four texels say.
float map_visibility(int index, VirtualLight light, vec3 position, vec3 plane_normal)
{
  mat3 frame = map_frame(light.normal);
  vec3 place = (position - light.position) * frame;
  vec3 normal = plane_normal * frame;
  float away = length(place);
  vec2 spot = (disc_point(place / max(away, 1e-30)) * 0.5 + 0.5) * float(map_side) - 0.5;
  ivec2 texel = ivec2(floor(spot));
  vec2 part = spot - vec2(texel);
  ivec2 tile = ivec2(index % map_columns, index / map_columns) * map_side;
  float visible = 0.0;
  for (int corner = 0; corner < 4; corner++) {
    ivec2 step_to = ivec2(corner & 1, corner >> 1);
    float weight = ((step_to.x == 1) ? part.x : 1.0 - part.x) * ((step_to.y == 1) ? part.y : 1.0 - part.y);
    ivec2 inside = clamp(texel + step_to, ivec2(0), ivec2(map_side - 1));
    visible += weight * texel_visibility(tile, inside, place, normal, SLACK * away);
  }
  return visible;
}

// Drawn while entries pass, in proportion to what they bring: for each channel one, mostly the same.
struct Pick {
  vec3 total;  // of magnitudes
  ivec3 index;
  vec3 side;  // 1, or -1 where the light is negative
};

void pick(inout Pick from, int index, vec3 light, float u)
{
  from.total += abs(light);
  for (int channel = 0; channel < 3; channel++) {
    if (u * from.total[channel] < abs(light[channel])) {
      from.index[channel] = index;
      from.side[channel] = sign(light[channel]);
    }
  }
}

// What the pick stands for, where a ray finds that it is seen, or, if `hidden`, that it is not. Never more than passed.
vec3 traced(Pick from, vec3 origin, bool hidden, uint salt)
{
  vec3 clear = vec3(0.0);
  for (int channel = 0; channel < 3; channel++) {
    int index = from.index[channel];
    int known = (channel > 0 && index == from.index[0]) ? 0 : (channel > 1 && index == from.index[1]) ? 1 : -1;
    if (known >= 0) {
      clear[channel] = clear[known];
    }
    else if (index >= 0) {
      clear[channel] = virtual_light_seen(virtual_light(index), origin, salt);
    }
  }
  return from.side * from.total * (hidden ? vec3(1.0) - clear : clear);
}

// Irradiance at a surface by all virtual lights, or what its diffuse closure reflects of it, as if it were Lambertian.
vec3 virtual_gather(Surface s, vec3 to_viewer, bool reflected, vec3 origin, float u, uint salt)
{
  vec3 sum = vec3(0.0);
  int groups = clamp(rays, 1, max(virtual_count, 1));
  for (int group = 0; group < groups; group++) {
    Pick lit;
    lit.total = vec3(0.0);
    lit.index = ivec3(-1);
    lit.side = vec3(0.0);
    Pick dark = lit;
    vec3 of_group = vec3(0.0);
    uvec3 roll = hash3(uvec3(salt, uint(group), 77u));
    for (int i = group * virtual_count / groups; i < (group + 1) * virtual_count / groups; i++) {
      VirtualLight light = virtual_light(i);
      vec3 direction;
      float bounded = bounded_kernel(light, s.position, near_radius, direction) * max(dot(s.normal, direction), 0.0);
      if (!(bounded > 0.0) || dot(direction, s.geometric_normal) <= 0.0) {
        continue;
      }
      float seen = map_visibility(i, light, s.position, s.geometric_normal);
      light.intensity *= passing_media(origin, direction, distance(light.position, origin), salt + uint(i));
      of_group += light.intensity * (bounded * seen);
      if (rays > 0) {
        roll = hash3(roll);
        pick(lit, i, light.intensity * (bounded * seen), to_unit(roll.x));
        pick(dark, i, light.intensity * (bounded * (1.0 - seen)), to_unit(roll.y));
      }
    }
    of_group -= traced(lit, origin, true, roll.z + 1u);
    // What is left of all taken away is rounding, of either sign.
    of_group = mix(of_group, vec3(0.0), lessThan(abs(of_group), 1e-6 * lit.total));
    sum += of_group + traced(dark, origin, false, roll.z);
  }
  return reflected ? sum * s.diffuse / PI : sum;
}
