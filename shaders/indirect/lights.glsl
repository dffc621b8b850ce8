// Virtual lights: points of surfaces that stand for the light which those reflect (`virtual_lights`, a column each):
//   row 0: position
//   row 1: normal of the surface
//   row 2: radiance over density, W/sr/m2 x m2; w: the share of it that was reflected at least once less than allowed

struct VirtualLight {
  vec3 position;
  vec3 normal;
  vec3 intensity;
  float shorter;
};

VirtualLight virtual_light(int index)
{
  VirtualLight light;
  light.position = texelFetch(virtual_lights, ivec2(index, 0), 0).xyz;
  light.normal = texelFetch(virtual_lights, ivec2(index, 1), 0).xyz;
  vec4 c = texelFetch(virtual_lights, ivec2(index, 2), 0);
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

// Irradiance at a surface by virtual lights that may be reflected once more. Every n-th of them stands for n, such that
// no more than PART are looked at; one of those is traced, along `direction`.
#define PART 64

vec3 virtual_irradiance(vec3 position, vec3 normal, float u, uint salt, out vec3 direction)
{
  direction = normal;
  int stride = (virtual_count + PART - 1) / PART;
  int first = int(hash3(uvec3(salt, 5u, uint(virtual_count))).x % uint(max(stride, 1)));
  float total = 0.0;
  for (int i = first; i < virtual_count; i += stride) {
    VirtualLight light = virtual_light(i);
    float kernel = bounded_kernel(light, position, direction) * max(dot(normal, direction), 0.0);
    total += kernel * luminance(abs(light.intensity)) * light.shorter;
  }
  if (!(total > DARK)) {
    return vec3(0.0);
  }
  float passed = 0.0;
  for (int i = first; i < virtual_count; i += stride) {
    VirtualLight light = virtual_light(i);
    float kernel = bounded_kernel(light, position, direction) * max(dot(normal, direction), 0.0);
    float share = kernel * luminance(abs(light.intensity)) * light.shorter;
    passed += share;
    if (share > 0.0 && u * total < passed) {
      vec3 origin = ray_origin(position, normal);
      vec3 path = ray_origin(light.position, light.normal) - origin;
      float reach = length(path);
      float visible = clear_path(origin, path / max(reach, 1e-30), reach, salt);
      return light.intensity * light.shorter * kernel * (float(stride) * total / share) * visible;
    }
  }
  return vec3(0.0);
}
