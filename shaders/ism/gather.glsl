// Virtual lights and their maps: every one brings what its map says, and a few rays correct that in the mean. Of those
// that are shown one is drawn and taken off if a ray finds it hidden, of those that are not one is added if it is seen.
#include "indirect/lights.glsl"
#include "ism/visibility.glsl"

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
      float seen = map_visibility(i, light.position, light.normal, s.position, s.geometric_normal, 0.0);
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
