// Virtual lights: points of surfaces that stand for the light which those reflect (`virtual_lights`, three vec4 each):
//   0: position
//   1: normal of the surface
//   2: radiance over density, W/sr/m2 x m2; w: the share of it that was reflected at least once less than allowed
#define VIRTUAL_TEXELS 3

struct VirtualLight {
  vec3 position;
  vec3 normal;
  vec3 intensity;
  float shorter;
};

VirtualLight virtual_light(int index)
{
  VirtualLight light;
  vec4 a = virtual_lights.light[index * VIRTUAL_TEXELS];
  vec4 b = virtual_lights.light[index * VIRTUAL_TEXELS + 1];
  vec4 c = virtual_lights.light[index * VIRTUAL_TEXELS + 2];
  light.position = a.xyz;
  light.normal = b.xyz;
  light.intensity = c.xyz;
  light.shorter = c.w;
  return light;
}

// Geometry term without the receiver's cosine, bounded: cos / max(d2, r2).
float bounded_kernel(VirtualLight light, vec3 position, out vec3 direction)
{
  vec3 path = light.position - position;
  float squared = max(dot(path, path), 1e-30);
  direction = path * inversesqrt(squared);
  return max(-dot(light.normal, direction), 0.0) / max(squared, near_radius * near_radius);
}

// Radiance that a surface reflects of all virtual lights. Of all of them `count` are traced, drawn in proportion to what
// they bring unblocked (systematic resampling).
vec3 virtual_reflection(Surface s, vec3 to_viewer, vec3 origin, int count, float u, uint salt)
{
  float total = 0.0;
  vec3 direction;
  for (int i = 0; i < virtual_count; i++) {
    VirtualLight light = virtual_light(i);
    float kernel = bounded_kernel(light, s.position, direction) * max(dot(s.normal, direction), 0.0);
    total += kernel * luminance(abs(light.intensity));
  }
  if (!(total > 0.0)) {
    return vec3(0.0);
  }
  float step_size = total / float(count);
  float mark = u * step_size;
  float passed = 0.0;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < virtual_count; i++) {
    VirtualLight light = virtual_light(i);
    float kernel = bounded_kernel(light, s.position, direction);
    float share = kernel * max(dot(s.normal, direction), 0.0) * luminance(abs(light.intensity));
    passed += share;
    if (share > 0.0 && mark < passed) {
      float marks = ceil((passed - mark) / step_size);
      mark += marks * step_size;
      if (dot(direction, s.geometric_normal) > 0.0) {
        vec3 path = ray_origin(light.position, light.normal) - origin;
        float reach = length(path);
        vec3 reflected = diffuse_reflection(s.diffuse, s.diffuse_roughness, s.normal, to_viewer, direction);
        vec3 arriving = light.intensity * (kernel * marks * step_size / share);
        sum += reflected * arriving * clear_path(origin, path / max(reach, 1e-30), reach, salt + uint(i));
      }
    }
  }
  return sum;
}

// Irradiance at a surface by virtual lights that may be reflected once more; one of them is traced.
vec3 virtual_irradiance(vec3 position, vec3 normal, float u, uint salt)
{
  float total = 0.0;
  vec3 direction;
  for (int i = 0; i < virtual_count; i++) {
    VirtualLight light = virtual_light(i);
    float kernel = bounded_kernel(light, position, direction) * max(dot(normal, direction), 0.0);
    total += kernel * luminance(abs(light.intensity)) * light.shorter;
  }
  if (!(total > 0.0)) {
    return vec3(0.0);
  }
  float passed = 0.0;
  for (int i = 0; i < virtual_count; i++) {
    VirtualLight light = virtual_light(i);
    float kernel = bounded_kernel(light, position, direction) * max(dot(normal, direction), 0.0);
    float share = kernel * luminance(abs(light.intensity)) * light.shorter;
    passed += share;
    if (share > 0.0 && u * total < passed) {
      vec3 origin = ray_origin(position, normal);
      vec3 path = ray_origin(light.position, light.normal) - origin;
      float reach = length(path);
      float visible = clear_path(origin, path / max(reach, 1e-30), reach, salt);
      return light.intensity * light.shorter * kernel * (total / share) * visible;
    }
  }
  return vec3(0.0);
}
