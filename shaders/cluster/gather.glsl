// Virtual lights whose clusters are seen: all members of a cluster have its visibility, and rays to single members correct
// it in the mean.
#include "indirect/lights.glsl"
#include "cluster/visibility.glsl"

#define LEAST_DOUBT 0.1  // of every cluster: what maps are sure of may be wrong
#define LEAST_PASSING 0.02  // through media: of members that stand nearer than the middle more may

// What a virtual light brings to a surface if nothing is between.
vec3 member_light(int index, Surface s, out vec3 direction)
{
  VirtualLight light = virtual_light(index);
  float bounded = bounded_kernel(light, s.position, near_radius, direction) * max(dot(s.normal, direction), 0.0);
  return light.intensity * ((dot(direction, s.geometric_normal) > 0.0) ? bounded : 0.0);
}

// Share that media let pass from a place of the cluster.
vec3 passing_from(vec3 place, vec3 origin, uint salt)
{
  vec3 path = place - origin;
  float reach = length(path);
  return passing_media(origin, path / max(reach, 1e-30), reach, salt);
}

// Light of one member, drawn in proportion to what it brings, that stands for all: `total` is the sum of luminances.
vec3 traced_member(Cluster c, Surface s, vec3 origin, float total, float u, uint salt)
{
  float passed = 0.0;
  for (int i = c.first; i < c.first + c.count; i++) {
    vec3 direction;
    vec3 light = member_light(i, s, direction);
    float share = luminance(abs(light));
    passed += share;
    if (share > 0.0 && u * total < passed) {
      VirtualLight member = virtual_light(i);
      light *= total / share * virtual_light_seen(member, origin, salt);
      light *= layers_color(distance(member.position, origin));
      return light * passing_from(member.position, origin, salt);
    }
  }
  return vec3(0.0);
}

// Irradiance at a surface by all virtual lights, or what its diffuse closure reflects of it, as if it were Lambertian.
vec3 virtual_gather(Surface s, vec3 to_viewer, bool reflected, vec3 origin, float u, uint salt)
{
  vec3 sum = vec3(0.0);
  bool takes_light = false;  // lamps of negative power
  int groups = clamp(rays, 1, max(cluster_count, 1));
  for (int group = 0; group < groups; group++) {
    // Of a group of clusters one is corrected, drawn while they pass in proportion to what may be wrong.
    float doubts = 0.0;
    float doubt_of_picked = 0.0;
    float total_of_picked = 0.0;
    vec3 guess_of_picked = vec3(0.0);
    int picked = -1;
    uvec3 roll = hash3(uvec3(salt, uint(group), 77u));
    for (int k = group * cluster_count / groups; k < (group + 1) * cluster_count / groups; k++) {
      Cluster c = cluster_read(k);
      vec3 unblocked = vec3(0.0);
      float total = 0.0;
      for (int i = c.first; i < c.first + c.count; i++) {
        vec3 direction;
        vec3 light = member_light(i, s, direction);
        unblocked += light;
        total += luminance(abs(light));
      }
      if (!(total > DARK)) {
        continue;
      }
      float doubt;
      vec3 passing = passing_from(c.middle, origin, salt + uint(k));
      vec3 guess = unblocked * passing * cluster_visibility(c, s.position, s.geometric_normal, doubt);
      sum += guess;
      takes_light = takes_light || any(lessThan(unblocked, vec3(0.0)));
      doubt = total * max(doubt, LEAST_DOUBT) * max(max_component(passing), LEAST_PASSING);
      doubts += doubt;
      roll = hash3(roll);
      if (to_unit(roll.x) * doubts < doubt) {
        picked = k;
        doubt_of_picked = doubt;
        total_of_picked = total;
        guess_of_picked = guess;
      }
    }
    if (rays > 0 && picked >= 0) {
      vec3 light = traced_member(cluster_read(picked), s, origin, total_of_picked, to_unit(roll.y), roll.z);
      sum += (light - guess_of_picked) * (doubts / doubt_of_picked);
    }
  }
  sum = takes_light ? sum : max(sum, vec3(0.0));  // where rays take more than the guesses gave
  return reflected ? sum * s.diffuse / PI : sum;
}
