// The caustic of a light on what rays have met: what diffuse closures there reflect of the irradiance that a kept map holds
// for their place. Of the four texels around it those count whose surface lies on the hit's plane.
#include "lib/gbuffer.glsl"
#include "hits/path.glsl"
#include "caustics/map_texels.glsl"

// Place that a texel of the map shows, `depth` along the view's axis.
vec3 place_of(vec2 texel, vec2 size, float depth)
{
  vec2 window = mix(map_view.frame.xz, map_view.frame.yw, (texel + 0.5) / size);
  vec3 across = window.x * map_view.right.xyz + window.y * map_view.up.xyz;
  float spread = (map_view.eye.w > 0.5) ? 1.0 : depth;
  return map_view.eye.xyz + spread * across - depth * map_view.backward.xyz;
}

vec3 irradiance_at(vec3 position, vec3 normal)
{
  ivec2 size = kept_map_size();
  MapPlace at = map_place(position, size);
  if (!at.inside) {
    return vec3(0.0);
  }
  // The light is on the side that the hit faces.
  vec3 to_light = (map_view.eye.w > 0.5) ? map_view.backward.xyz : map_view.eye.xyz - position;
  if (dot(normal, to_light) <= 0.0) {
    return vec3(0.0);
  }
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int k = 0; k < 4; k++) {
    ivec2 other = map_texel(at, k, size);
    vec4 kept = kept_map_fetch(other);
    vec3 offset = place_of(vec2(other), vec2(size), kept.w) - position;
    float weight = (kept.w > 0.0) ? map_weight(at, k, offset, normal) : 0.0;
    sum += weight * kept.rgb;
    weights += weight;
  }
  return (weights > 0.0) ? sum / weights : vec3(0.0);
}

void main()
{
  out_glossy_indirect = vec4(0.0);
#ifdef TRANSMISSION
  out_transmission_indirect = vec4(0.0);
#endif
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 path = met_path_fetch(pixel);
  int code = int(path.w + 0.5);
  vec4 place = surface_position_fetch(pixel);
  vec3 albedo = surface_diffuse_fetch(pixel).rgb;
  if (code == 0 || place.w == 0.0 || max(albedo.r, max(albedo.g, albedo.b)) <= 0.0) {
    return;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  vec3 reflected = albedo / PI * irradiance_at(place.xyz, normal);
  vec4 light = vec4(path.rgb * hit_passed_fetch(pixel).rgb * reflected, 0.0);
  if (path_is_glossy(code)) {
    out_glossy_indirect = light;
  }
#ifdef TRANSMISSION
  else {
    out_transmission_indirect = light;
  }
#endif
}
