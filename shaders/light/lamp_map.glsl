// What a lamp's node tree makes of its light: factors by direction, by place on the lamp and by distance, from the image
// of addon/sources/lamp_maps.py. Only in programs whose lamps have such trees (HAS_LAMP_MAPS).
//
// Row `number` of the image tells of one lamp; each tile has a border of one texel around it:
//   0, 1, 2: the lamp's axes (unit)   w: 1 octahedral map of all directions, 2 of a cone around -z, 0 none;
//                                        1 / (2 sin(half angle / 2)) of the cone; 1: directions from the lamp's middle
//   3: tile of directions: x, y of its first texel, side
//   4: tile of places: x, y, side     w: 1 if there is one
//   5: distances: x, y, count (0: none), logarithm of the first
//   6, 7: half width and height over their squared lengths   w of 6: steps per unit of the logarithm
//   8: the lamp's centre
#include "lib/math.glsl"

vec3 lamp_tile(ivec2 first, float side, vec2 place)
{
  vec2 at = clamp(place, 0.0, 1.0) * side + 0.5;  // of texels, with the border's before
  ivec2 texel = ivec2(floor(at));
  vec2 share = at - vec2(texel);
  texel += first;
  vec3 low = mix(lamp_maps_fetch(texel).rgb, lamp_maps_fetch(texel + ivec2(1, 0)).rgb, share.x);
  vec3 high = mix(lamp_maps_fetch(texel + ivec2(0, 1)).rgb, lamp_maps_fetch(texel + ivec2(1, 1)).rgb, share.x);
  return mix(low, high, share.y);
}

// Place in the map of a unit direction in the lamp's own axes.
vec2 lamp_direction_place(vec3 local, float mode, float cone)
{
  if (mode > 1.5) {  // equal areas around -z
    return 0.5 + 0.5 * cone * local.xy / sqrt(max(0.5 - 0.5 * local.z, 1e-12));  // over the cosine of half the angle
  }
  vec3 p = local / (abs(local.x) + abs(local.y) + abs(local.z));
  vec2 folded = (p.z >= 0.0) ? p.xy : (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
  return 0.5 + 0.5 * folded;
}

// Of light that leaves the lamp along `direction` (unit) from the place `from`, relative to the render origin, and goes so
// far, m.
vec3 lamp_map(int number, vec3 direction, vec3 from, float path)
{
  vec4 x = lamp_maps_fetch(ivec2(0, number));
  vec4 y = lamp_maps_fetch(ivec2(1, number));
  vec4 z = lamp_maps_fetch(ivec2(2, number));
  vec3 offset = from - lamp_maps_fetch(ivec2(8, number)).xyz;
  vec3 factor = vec3(1.0);
  if (x.w > 0.5) {
    vec3 d = (z.w > 0.5) ? safe_normalize(offset) : direction;
    vec4 tile = lamp_maps_fetch(ivec2(3, number));
    vec3 local = vec3(dot(x.xyz, d), dot(y.xyz, d), dot(z.xyz, d));
    factor *= lamp_tile(ivec2(tile.xy + 0.5), tile.z, lamp_direction_place(local, x.w, y.w));
  }
  vec4 tile_of_places = lamp_maps_fetch(ivec2(4, number));
  vec4 u = lamp_maps_fetch(ivec2(6, number));
  if (tile_of_places.w > 0.5) {
    vec2 place = vec2(dot(u.xyz, offset), dot(lamp_maps_fetch(ivec2(7, number)).xyz, offset));
    factor *= lamp_tile(ivec2(tile_of_places.xy + 0.5), tile_of_places.z, 0.5 + 0.5 * place);
  }
  vec4 far = lamp_maps_fetch(ivec2(5, number));
  if (far.z > 0.5) {
    float at = clamp((log(max(path, 1e-30)) - far.w) * u.w, 0.0, far.z - 1.0);
    int first = min(int(at), int(far.z) - 2);
    ivec2 texel = ivec2(far.xy + 0.5) + ivec2(first, 0);
    vec3 found = mix(lamp_maps_fetch(texel).rgb, lamp_maps_fetch(texel + ivec2(1, 0)).rgb, at - float(first));
    factor *= found * (1.0 + path * path);
  }
  return factor;
}
