// Virtual lights whose clusters are seen: all members of a cluster have its visibility.
#include "indirect/lights.glsl"
#include "cluster/visibility.glsl"

// Irradiance at a surface by all virtual lights, or what its diffuse closure reflects of it, as if it were Lambertian.
vec3 virtual_gather(Surface s, vec3 to_viewer, bool reflected, vec3 origin, float u, uint salt)
{
  vec3 sum = vec3(0.0);
  for (int k = 0; k < cluster_count; k++) {
    Cluster c = cluster_read(k);
    vec3 unblocked = vec3(0.0);
    for (int i = 0; i < c.count; i++) {
      VirtualLight light = virtual_light(c.first + i);
      vec3 direction;
      float kernel = bounded_kernel(light, s.position, direction) * max(dot(s.normal, direction), 0.0);
      unblocked += light.intensity * ((dot(direction, s.geometric_normal) > 0.0) ? kernel : 0.0);
    }
    if (max_component(abs(unblocked)) > 0.0) {
      sum += unblocked * cluster_visibility(c, s.position, s.geometric_normal);
    }
  }
  return reflected ? sum * s.diffuse / PI : sum;
}
