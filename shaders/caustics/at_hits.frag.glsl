// The caustic of a light on what rays have met: what diffuse closures there reflect of the irradiance that a kept map holds
// for their place. Of the four texels around it those count whose surface lies on the hit's plane.
#include "lib/gbuffer.glsl"
#include "hits/path.glsl"

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
  vec4 p = vec4(position, 1.0);
  float w = dot(map_view.row_w, p);
  vec2 size = vec2(kept_map_size());
  vec2 at = (vec2(dot(map_view.row_x, p), dot(map_view.row_y, p)) / max(w, 1e-30) * 0.5 + 0.5) * size - 0.5;
  if (w <= 0.0 || any(lessThan(at, vec2(-1.0))) || any(greaterThanEqual(at, size))) {
    return vec3(0.0);
  }
  // The light is on the side that the hit faces.
  vec3 to_light = (map_view.eye.w > 0.5) ? map_view.backward.xyz : map_view.eye.xyz - position;
  if (dot(normal, to_light) <= 0.0) {
    return vec3(0.0);
  }
  float texel = (map_view.frame.y - map_view.frame.x) / map_view.film.x * ((map_view.eye.w > 0.5) ? 1.0 : w);
  vec2 corner = floor(at);
  vec2 share = at - corner;
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int k = 0; k < 4; k++) {
    vec2 step = vec2(float(k & 1), float(k >> 1));
    ivec2 other = clamp(ivec2(corner + step), ivec2(0), ivec2(size) - 1);
    vec4 kept = kept_map_fetch(other);
    vec3 offset = place_of(vec2(other), size, kept.w) - position;
    vec2 tent = mix(vec2(1.0) - share, share, step);
    float weight = (kept.w > 0.0 && abs(dot(offset, normal)) < 1.5 * texel) ? max(tent.x * tent.y, 1e-4) : 0.0;
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
