// Virtual lights that are seen along rays.
#include "indirect/lights.glsl"

// Irradiance at a surface by all virtual lights, and, given the surface's diffuse closure, what it reflects of it. Of all
// of them `rays` are traced, drawn in proportion to what they bring unblocked (systematic resampling); 0: none is, and
// walls let all light pass.
vec3 virtual_gather(Surface s, vec3 to_viewer, bool reflected, vec3 origin, float u, uint salt)
{
  float total = 0.0;
  vec3 unblocked = vec3(0.0);
  vec3 direction;
  for (int i = 0; i < virtual_count; i++) {
    VirtualLight light = virtual_light(i);
    float kernel = bounded_kernel(light, s.position, direction) * max(dot(s.normal, direction), 0.0);
    total += kernel * luminance(abs(light.intensity));
    unblocked += kernel * light.intensity;
  }
  if (!(total > DARK) || rays == 0) {
    return reflected ? unblocked * s.diffuse / PI : unblocked;
  }
  float step_size = total / float(rays);
  float mark = u * step_size;
  float passed = 0.0;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < virtual_count; i++) {
    VirtualLight light = virtual_light(i);
    float kernel = bounded_kernel(light, s.position, direction);
    float cosine = max(dot(s.normal, direction), 0.0);
    float share = kernel * cosine * luminance(abs(light.intensity));
    passed += share;
    if (share > 0.0 && mark < passed) {
      float marks = ceil((passed - mark) / step_size);
      mark += marks * step_size;
      if (dot(direction, s.geometric_normal) > 0.0) {
        vec3 path = ray_origin(light.position, light.normal) - origin;
        float reach = length(path);
        vec3 arriving = light.intensity * (kernel * marks * step_size / share);
        arriving *= clear_path(origin, path / max(reach, 1e-30), reach, salt + uint(i));
        sum += arriving * (reflected ? diffuse_reflection(s.diffuse, s.diffuse_roughness, s.normal, to_viewer, direction)
                                     : vec3(cosine));
      }
    }
  }
  return sum;
}
