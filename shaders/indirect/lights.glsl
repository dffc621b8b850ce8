// Virtual lights: points of surfaces that stand for the light which those reflect (`virtual_lights`, a column each):
//   row 0: position; w: luminance of row 2
//   row 1: normal of the surface; w: the share of row 2 that was reflected at least once less than allowed
//   row 2: radiance over density, W/sr/m2 x m2; w: least squared distance at which it stands for its area

struct VirtualLight {
  vec3 position;
  vec3 normal;
  vec3 intensity;
  float footprint;
};

VirtualLight virtual_light(int index)
{
  VirtualLight light;
  light.position = virtual_lights_fetch(ivec2(index, 0)).xyz;
  light.normal = virtual_lights_fetch(ivec2(index, 1)).xyz;
  vec4 sent = virtual_lights_fetch(ivec2(index, 2));
  light.intensity = sent.xyz;
  light.footprint = sent.w;
  return light;
}

// Geometry term without the receiver's cosine, bounded: cos / max(d2, reach2). Nor is a virtual light brighter than its area
// would be: one that its finder saw at a grazing angle stands for a large area, and beside it may lie what faces it.
float bounded_kernel(VirtualLight light, vec3 position, float reach, out vec3 direction)
{
  vec3 path = light.position - position;
  float squared = max(dot(path, path), 1e-30);
  direction = path * inversesqrt(squared);
  return max(-dot(light.normal, direction), 0.0) / max(squared, max(reach * reach, light.footprint));
}

// Luminance of the irradiance by a virtual light if nothing is between; `shorter`: by the light in it that may be
// reflected once more.
float unblocked_share(int index, vec3 position, vec3 normal, float reach, bool shorter)
{
  vec4 a = virtual_lights_fetch(ivec2(index, 0));
  vec4 b = virtual_lights_fetch(ivec2(index, 1));
  vec3 path = a.xyz - position;
  float squared = max(dot(path, path), 1e-30);
  float cosines = max(-dot(b.xyz, path), 0.0) * max(dot(normal, path), 0.0) / squared;
  return cosines / max(squared, reach * reach) * a.w * (shorter ? b.w : 1.0);
}

// Whether nothing is between a place beside a surface and a virtual light: 1 or 0.
float virtual_light_seen(VirtualLight light, vec3 origin, uint salt)
{
  vec3 path = ray_origin(light.position, light.normal) - origin;
  float reach = length(path);
  return clear_path(origin, path / max(reach, 1e-30), reach, salt);
}

// Intensity of a virtual light that comes through surfaces and media to a place beside a surface.
vec3 virtual_light_arriving(VirtualLight light, vec3 origin, uint salt)
{
  vec3 path = light.position - origin;
  float reach = length(path);
  vec3 direction = path / max(reach, 1e-30);
  float seen = virtual_light_seen(light, origin, salt);
  vec3 colored = seen * layers_color(reach);
  return light.intensity * colored * passing_media(origin, direction, reach, salt);
}

// Irradiance at a surface by virtual lights; `shorter`: by the light in them that may be reflected once more. Every n-th of
// them stands for n, such that no more than PART are looked at; one of those is traced, along `direction`.
#ifndef PART
#define PART 64
#endif

vec3 virtual_irradiance(vec3 position, vec3 normal, float reach, bool shorter, uint salt, out vec3 direction)
{
  direction = normal;
  int stride = (virtual_count + PART - 1) / PART;
  int first = int(hash3(uvec3(salt, 5u, uint(virtual_count))).x % uint(max(stride, 1)));
  float total = 0.0;
  float chosen_share = 0.0;
  int chosen = 0;
  uint roll = salt;
  for (int i = first; i < virtual_count; i += stride) {
    float share = unblocked_share(i, position, normal, reach, shorter);
    total += share;
    if (draw_passing(share, total, roll)) {
      chosen_share = share;
      chosen = i;
    }
  }
  if (!(total > DARK) || !(chosen_share > 0.0)) {
    return vec3(0.0);
  }
  VirtualLight light = virtual_light(chosen);
  float part = shorter ? virtual_lights_fetch(ivec2(chosen, 1)).w : 1.0;
  float bounded = bounded_kernel(light, position, reach, direction) * max(dot(normal, direction), 0.0);
  return virtual_light_arriving(light, ray_origin(position, normal), salt)
         * (part * bounded * (float(stride) * total / chosen_share));
}
