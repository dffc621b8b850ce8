// Irradiance in all regions of one level, from what some have gathered. PULL, from fine to coarse: regions that are split
// get the mean of their quarters. Else, from coarse to fine: regions that a larger one covers interpolate between it and
// its neighbours. Alpha tells whether there is a surface.
#include "ask/view.glsl"
#include "indirect/regions.glsl"

vec3 normal_at(ivec2 pixel)
{
  return octahedral_decode(surface_normal_fetch(pixel).xy);
}

// How well what is known at a pixel does for a place: by plane and normal.
float likeness(ivec2 pixel, vec3 position, vec3 normal, float reach)
{
  float off_plane = dot(surface_position_fetch(pixel).xyz - position, normal) / reach;
  float alike = max(dot(normal_at(pixel), normal), 0.0);
  alike *= alike;
  alike *= alike;
  return alike * alike * exp(-off_plane * off_plane);
}

// What a split region of level 1 has: the pixel that stands for it has gathered, if it shows a surface.
vec4 of_split_pixels(ivec2 region)
{
  ivec2 pixel = region_pixel(region, 1);
  bool inside = all(equal(2 * region + 1 - grid_offset, pixel)) && surface_position_fetch(pixel).w != 0.0;
  return inside ? gathered_fetch(2 * region + 1) : vec4(0.0);
}

void main()
{
  out_irradiance = vec4(0.0);
  ivec2 region = ivec2(gl_FragCoord.xy);
  ivec2 pixel = region_pixel(region, level);
  vec4 surface = surface_position_fetch(pixel);
  if (surface.w == 0.0) {
    return;
  }
  float reach = 0.02 * (view_is_parallel(film_view.eye) ? depth_scale : max(view_growth(surface.xyz), 1e-30));
  vec3 normal = normal_at(pixel);
  vec3 sum = vec3(0.0);
  float weights = 0.0;
#ifdef PULL
  if (region_flags_fetch(region).x < 0.5) {
    return;
  }
  for (int child = 0; child < 2; child++) {  // two diagonals: the mean of both ends is that of the middle
    vec3 pair = vec3(0.0);
    float weight = 1.0;
    for (int end = 0; end < 2; end++) {
      ivec2 finer = 2 * region + ivec2((end == 0) ? child : 1 - child, end);
      vec2 flags = finer_flags_fetch(finer).xy;
      vec4 known = vec4(0.0);
      if (flags.x > 0.5) {
        known = (level == 2) ? of_split_pixels(finer) : finer_irradiance_fetch(finer);
      }
      else if (flags.y == 1.0) {
        known = gathered_fetch(region_place(finer, level - 1));
      }
      pair += 0.5 * known.rgb;
      weight *= known.a * likeness(region_pixel(finer, level - 1), surface.xyz, normal, reach);
    }
    sum += weight * pair;
    weights += weight;
  }
  out_irradiance = (weights > 1e-6) ? vec4(sum / weights, 1.0) : vec4(0.0);
#else
  vec2 flags = (level > 0) ? region_flags_fetch(region).xy : vec2(0.0, 1.0);
  if (flags.x > 0.5) {
    out_irradiance = (level == 1) ? of_split_pixels(region) : pulled_fetch(region);
    return;
  }
  if (flags.y != 1.0) {
    return;
  }
  if (level == levels || coarser_flags_fetch(region >> 1).x > 0.5) {
    out_irradiance = gathered_fetch(region_place(region, level));
    return;
  }
  ivec2 parent = region >> 1;
  ivec2 side = 2 * (region & 1) - 1;
  // Linear between the pixels that stand for regions; of two pixels of a region the second one stands for it.
  vec2 near = (level > 0) ? vec2(0.75) : mix(vec2(0.5), vec2(1.0), vec2(region & 1));
  for (int corner = 0; corner < 4; corner++) {
    ivec2 step_to = ivec2(corner & 1, corner >> 1);
    ivec2 coarser = clamp(parent + step_to * side, ivec2(0), coarser_irradiance_size() - 1);
    vec4 known = coarser_irradiance_fetch(coarser);
    vec2 share = mix(near, 1.0 - near, vec2(step_to));
    float weight = share.x * share.y * known.a;
    weight *= likeness(region_pixel(coarser, level + 1), surface.xyz, normal, reach);
    sum += weight * known.rgb;
    weights += weight;
  }
  out_irradiance = (weights > 1e-6) ? vec4(sum / weights, 1.0) : coarser_irradiance_fetch(parent);
#endif
}
