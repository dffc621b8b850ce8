// What a tile of a panoramic camera shows (addon/scene/panorama.py), for the pixels that look through it. FROM_TILE: outputs
// from images of the same number. `film_view` is the panorama; the tile is given in the camera's axes.
#include "ask/view.glsl"

void main()
{
  vec3 seen = panorama_of_pixel(gl_FragCoord.xy);
  vec3 way = vec3(dot(tile_right, seen), dot(tile_up, seen), -dot(tile_backward, seen));
  vec2 at = way.xy / max(way.z, 1e-9);
  if (way.z <= 0.0 || any(lessThan(at, tile_bounds.xz)) || any(greaterThan(at, tile_bounds.yw))) {
    discard;
  }
  vec3 onward = panorama_onward(seen, tile_eye);
  at = vec2(dot(tile_right, onward), dot(tile_up, onward)) / max(-dot(tile_backward, onward), 1e-9);
  vec2 size = vec2(tile_0_size());
  ivec2 texel = ivec2(floor((at - tile_frame.xz) / (tile_frame.yw - tile_frame.xz) * size - tile_shift));
  texel = clamp(texel, ivec2(0), ivec2(size) - 1);
  FROM_TILE
}
