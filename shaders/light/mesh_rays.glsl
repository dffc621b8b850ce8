// Points of emissive triangles of each pixel's own, and their visibility by rays: of several that are drawn by power one is
// kept, in proportion to the light that it brings there if nothing is in the way, and stands for all of them (resampled
// importance sampling, Talbot et al. 2005). So what is unblocked has the noise of CANDIDATE_POINTS, for one ray.
//
// With `mesh_light_least` above 0 they bring what points that all pixels share leave out: to those a point is no nearer
// than the root of mesh_light_least over its luminance. Nothing is missing outside of the box from `near_low` to
// `near_high`.
//
// `mesh_lights`, a list of four texels for each triangle: corner; w: sum of the power up to it, as a share of all | edge;
// w: 1 where it shines to its normal's side alone | other edge; w: -1 where the normal is turned | radiance.
#include "light/sources.glsl"
#include "lib/gbuffer.glsl"
#include "trace/rays.glsl"

vec4 mesh_light(int triangle, int part)
{
  int texel = 4 * triangle + part;
  return mesh_lights_fetch(ivec2(texel & 2047, texel >> 11));
}

int mesh_light_at(float x)
{
  int low = 0;
  int high = mesh_light_count;
  while (high - low > 1) {
    int middle = (low + high) / 2;
    if (mesh_light(middle, 0).w <= x) {
      low = middle;
    }
    else {
      high = middle;
    }
  }
  return low;
}

// `number`: of the `light_count` rays of this sample, which divide the power among them.
Light own_point(Light light, int number)
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 29u));
  float first = scrambled(film_view.bits_x, salt.x);
  float second = scrambled(film_view.bits_y, salt.y);
  vec3 position = surface_position_fetch(pixel).xyz;
  light.radiance = vec3(0.0);
  if (mesh_light_least > 0.0 && any(greaterThan(abs(2.0 * position - near_low - near_high), near_high - near_low))) {
    return light;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).xy);
  float roll = to_unit(hash3(uvec3(salt.z, uint(film_view.sample_index), uint(number))).x);
  float total = 0.0;
  float chosen = 0.0;
  float missing = 1.0;
  for (int k = 0; k < CANDIDATE_POINTS; k++) {
    float x = (float(number) + (float(k) + first) / float(CANDIDATE_POINTS)) / float(light_count);
    int triangle = mesh_light_at(x);
    vec4 corner = mesh_light(triangle, 0);
    vec4 edge = mesh_light(triangle, 1);
    vec4 other = mesh_light(triangle, 2);
    float above = (triangle + 1 < mesh_light_count) ? mesh_light(triangle + 1, 0).w : 1.0;
    float along = clamp((x - corner.w) / max(above - corner.w, 1e-12), 0.0, 1.0);
    float root = sqrt(fract(second + 0.618033989 * float(k)));
    vec3 point = corner.xyz + root * ((1.0 - along) * edge.xyz + along * other.xyz);
    vec3 facing = other.w * safe_normalize(cross(edge.xyz, other.xyz));
    vec3 radiance = mesh_light(triangle, 3).rgb;
    vec3 way = point - position;
    float shining = luminance(abs(radiance));
    float often = emissive_density(radiance, mesh_light_level);
    // What is drawn more often stands for less of the light, and may be nearer.
    float area = mesh_light_power / max(often * float(light_count), 1e-30);
    float squared = max(dot(way, way), light_footprint(light) * area);
    vec3 direction = safe_normalize(way);
    float cos_light = -dot(direction, facing);
    cos_light = (edge.w > 0.5) ? max(cos_light, 0.0) : abs(cos_light);
    // What is drawn more often counts the less: in proportion to luminance and, as often, to area.
    float left_out = 1.0;
    if (mesh_light_least > 0.0) {
      left_out = 1.0 - min(squared * often / mesh_light_least, 1.0);
    }
    float share = left_out * cos_light / squared * (0.1 + 0.9 * max(dot(normal, direction), 0.0));
    share *= shining / max(often, 1e-30);
    total += share;
    float chance = share / max(total, 1e-30);
    bool taken = share > 0.0 && roll < chance;
    roll = clamp(taken ? roll / chance : (roll - chance) / max(1.0 - chance, 1e-6), 0.0, 1.0);
    if (taken) {
      chosen = share;
      light.area = area;
      missing = left_out;
      light.point = light.centre = point;
      light.axis = facing;
      light.radiance = radiance;
      light.flags = (edge.w > 0.5) ? (light.flags | LIGHT_SIDED) : (light.flags & ~LIGHT_SIDED);
    }
  }
  // light.area: the density by which lobes share their light with points is that of a point alone. Both sides know it.
  light.radiance *= missing * total / max(float(CANDIDATE_POINTS) * chosen, 1e-30);
  return light;
}

#include "light/ray_visibility.glsl"
