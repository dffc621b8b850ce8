// Where the map of a light's view shows a place, and how much each of the four texels around it counts. `map_view` is the
// light's.
#include "lib/view.glsl"
struct MapPlace {
  bool inside;
  vec2 corner;
  vec2 share;
  float texel;  // side of a texel there, m
};

MapPlace map_place(vec3 position, ivec2 size)
{
  vec4 p = vec4(position, 1.0);
  float w = dot(map_view.row_w, p);
  vec2 at = (vec2(dot(map_view.row_x, p), dot(map_view.row_y, p)) / max(w, 1e-30) * 0.5 + 0.5) * vec2(size) - 0.5;
  MapPlace place;
  place.inside = w > 0.0 && !any(lessThan(at, vec2(-1.0))) && !any(greaterThanEqual(at, vec2(size)));
  place.texel = (map_view.frame.y - map_view.frame.x) / map_view.film.x * (view_is_parallel(map_view.eye) ? 1.0 : w);
  place.corner = floor(at);
  place.share = at - place.corner;
  return place;
}

ivec2 map_texel(MapPlace place, int k, ivec2 size)
{
  return clamp(ivec2(place.corner + vec2(float(k & 1), float(k >> 1))), ivec2(0), size - 1);
}

// Texel k counts if what it shows, `offset` away, lies on the place's plane, as far as the texel's own slant allows.
float map_weight(MapPlace place, int k, vec3 offset, vec3 normal)
{
  vec2 tent = mix(vec2(1.0) - place.share, place.share, vec2(float(k & 1), float(k >> 1)));
  return (abs(dot(offset, normal)) < 1.5 * place.texel) ? max(tent.x * tent.y, 1e-4) : 0.0;
}
