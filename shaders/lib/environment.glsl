// Radiance and sampling density of the world by direction. `environment_map` holds radiance over `world_light.color`,
// `environment_density_map` the density per steradian with which addon/sources/environment.py draws directions.
#include "lib/math.glsl"

// Blender's equirectangular convention: u = 0.5 looks along +X, u grows towards -Y, v grows upwards.
vec2 equirectangular_uv(vec3 direction)
{
  float azimuth = (direction.x == 0.0 && direction.y == 0.0) ? 0.0 : atan(direction.y, direction.x);
  return vec2(0.5 - azimuth / (2.0 * PI), 0.5 + asin(clamp(direction.z, -1.0, 1.0)) / PI);
}

vec3 environment_lookup_direction(vec3 direction)
{
  vec4 d = vec4(direction, 1.0);
  return safe_normalize(vec3(dot(world_light.map_x, d), dot(world_light.map_y, d), dot(world_light.map_z, d)));
}

vec3 environment_radiance(vec3 direction)
{
  ivec2 size = environment_map_size();
  vec2 uv = equirectangular_uv(environment_lookup_direction(direction));
  vec2 texel = uv * vec2(size) - 0.5;
  vec2 corner = floor(texel);
  vec2 t = texel - corner;
  int x0 = int(mod(corner.x, float(size.x)));
  int x1 = int(mod(corner.x + 1.0, float(size.x)));
  int y0 = clamp(int(corner.y), 0, size.y - 1);
  int y1 = clamp(int(corner.y) + 1, 0, size.y - 1);
  vec3 low = mix(environment_map_fetch(ivec2(x0, y0)).rgb, environment_map_fetch(ivec2(x1, y0)).rgb, t.x);
  vec3 high = mix(environment_map_fetch(ivec2(x0, y1)).rgb, environment_map_fetch(ivec2(x1, y1)).rgb, t.x);
  return mix(low, high, t.y) * world_light.color.rgb;
}

// Density per steradian of the drawn directions; 0 where the world is not sampled.
float environment_density(vec3 direction)
{
  ivec2 size = environment_density_map_size();
  vec2 uv = equirectangular_uv(environment_lookup_direction(direction));
  ivec2 cell = clamp(ivec2(uv * vec2(size)), ivec2(0), size - 1);
  return environment_density_map_fetch(cell).r;
}
