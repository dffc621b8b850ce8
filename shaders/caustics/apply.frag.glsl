// The caustic map on the picture: what diffuse closures reflect of the irradiance that it holds for their place. Of the four
// texels around it those count that show the same surface; `map_view` is the light's.
#include "lib/gbuffer.glsl"

void main()
{
  out_light = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 place = surface_position_fetch(pixel);
  if (place.w == 0.0) {
    return;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  vec4 p = vec4(place.xyz, 1.0);
  float w = dot(map_view.row_w, p);
  ivec2 size = receiver_position_size();
  vec2 at = (vec2(dot(map_view.row_x, p), dot(map_view.row_y, p)) / max(w, 1e-30) * 0.5 + 0.5) * vec2(size) - 0.5;
  if (w <= 0.0 || any(lessThan(at, vec2(-1.0))) || any(greaterThanEqual(at, vec2(size)))) {
    return;
  }
  float texel = (map_view.frame.y - map_view.frame.x) / map_view.film.x * ((map_view.eye.w > 0.5) ? 1.0 : w);
  vec2 corner = floor(at);
  vec2 share = at - corner;
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int k = 0; k < 4; k++) {
    vec2 step = vec2(float(k & 1), float(k >> 1));
    ivec2 other = clamp(ivec2(corner + step), ivec2(0), size - 1);
    vec4 there = receiver_position_fetch(other);
    vec3 facing = octahedral_decode(receiver_normal_fetch(other).zw);
    // On the same plane, and no farther along it than the texel's own slant allows.
    vec3 offset = there.xyz - place.xyz;
    bool same = there.w != 0.0 && dot(facing, normal) > 0.7 && abs(dot(offset, normal)) < 1.5 * texel;
    vec2 tent = mix(vec2(1.0) - share, share, step);
    float weight = same ? max(tent.x * tent.y, 1e-4) : 0.0;
    sum += weight * caustic_map_fetch(other).rgb;
    weights += weight;
  }
  if (weights > 0.0) {
    out_light = vec4(sum / weights * surface_diffuse_fetch(pixel).rgb / PI, 0.0);
  }
}
