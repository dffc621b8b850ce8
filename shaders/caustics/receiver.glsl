// Irradiance that the photon of a record brings to a place, W/m2: by its footprint, on the same surface alone, on the side of
// a wall that it is on: what would lie beyond is folded back.
#include "splat/footprint.glsl"

vec3 photon_irradiance(vec3 position, vec3 normal, float pixel)
{
  vec3 offset = position - splat_centre.xyz;
  vec3 facing = cross(safe_normalize(splat_first.xyz), safe_normalize(splat_second.xyz));
  float reach = sqrt(max(dot(splat_first.xyz, splat_first.xyz), 0.0));
  float off_plane = abs(dot(offset, facing));
  if (dot(normal, facing) < 0.6 || off_plane > 0.25 * reach + pixel) {
    return vec3(0.0);
  }
  // On a curved surface the footprint lies along it.
  vec3 along = offset - dot(offset, facing) * facing;
  vec3 wall = vec3(splat_first.w, splat_second.w, splat_value.w);
  vec2 place = footprint_place(splat_first.xyz, splat_second.xyz, along);
  float beyond = dot(place, wall.xy) - wall.z;
  float share = footprint_kernel(place) + footprint_kernel(place - 2.0 * beyond * wall.xy);
  return splat_value.rgb * ((beyond > 0.0) ? 0.0 : share * footprint_peak(splat_first.xyz, splat_second.xyz));
}
