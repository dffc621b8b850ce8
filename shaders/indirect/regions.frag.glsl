// Irradiance by virtual lights in the regions of one level: gathered where the region stands for itself, interpolated from
// the coarser level where a larger region covers it, nothing where it is split. From the coarsest level down to pixels.
#include "indirect/path.glsl"
#include "generated/gather"

// The pixel that stands for a region.
ivec2 region_pixel(ivec2 region, int level_of_region)
{
  ivec2 pixel = (region << level_of_region) + ((1 << level_of_region) >> 1) - grid_offset;
  return clamp(pixel, ivec2(0), textureSize(surface_position, 0) - 1);
}

// Bilinear between four coarser regions, those that lie on the same surface.
vec4 interpolated(ivec2 region, Surface s)
{
  ivec2 parent = region >> 1;
  ivec2 side = 2 * (region & 1) - 1;
  float reach = 0.02 * ((film_view.eye.w > 0.5) ? depth_scale : length(s.position - film_view.eye.xyz));
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int corner = 0; corner < 4; corner++) {
    ivec2 step_to = ivec2(corner & 1, corner >> 1);
    ivec2 coarser = parent + step_to * side;
    if (any(lessThan(coarser, ivec2(0))) || any(greaterThanEqual(coarser, textureSize(coarser_irradiance, 0)))) {
      continue;
    }
    vec4 known = texelFetch(coarser_irradiance, coarser, 0);
    if (known.a == 0.0) {
      continue;
    }
    ivec2 pixel = region_pixel(coarser, level + 1);
    vec3 normal = octahedral_decode(texelFetch(surface_normal, pixel, 0).xy);
    float off_plane = dot(texelFetch(surface_position, pixel, 0).xyz - s.position, s.normal) / max(reach, 1e-30);
    float alike = pow(max(dot(normal, s.normal), 0.0), 8.0) * exp(-off_plane * off_plane);
    float bilinear = ((step_to.x == 0) ? 0.75 : 0.25) * ((step_to.y == 0) ? 0.75 : 0.25);
    sum += bilinear * alike * known.rgb;
    weights += bilinear * alike;
  }
  return (weights > 1e-6) ? vec4(sum / weights, 1.0) : texelFetch(coarser_irradiance, parent, 0);
}

void main()
{
  out_irradiance = vec4(0.0);
  ivec2 region = ivec2(gl_FragCoord.xy);
  ivec2 first = (region << level) - grid_offset;
  if (any(lessThan(first + (1 << level), ivec2(1))) || any(greaterThanEqual(first, textureSize(surface_position, 0)))) {
    return;
  }
  if (level > 0 && texelFetch(region_flags, region, 0).x > 0.5) {
    return;
  }
  ivec2 pixel = region_pixel(region, level);
  Surface s = SURFACE_READ(pixel);
  if (!s.hit) {
    return;
  }
  if (level < levels && texelFetch(coarser_flags, region >> 1, 0).x < 0.5) {
    out_irradiance = interpolated(region, s);
    return;
  }
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 31u));
  uvec3 roll = hash3(uvec3(uvec2(pixel), uint(film_view.sample_index * 1024 + 7)));
  vec3 origin = ray_origin(s.position, s.geometric_normal);
  float choice = scrambled(film_view.bits_w, salt.z);
  out_irradiance = vec4(virtual_gather(s, vec3(0.0), false, origin, choice, salt.x + roll.x), 1.0);
}
