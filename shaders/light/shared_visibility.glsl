// Visibility between the corners of a cell (light/visibility_cells.frag.glsl), or what was looked up for the pixel.
#include "light/sources.glsl"
#include "light/cell_corners.glsl"

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  ivec2 cell = pixel / RATE;
  int index = light.base / LIGHT_TEXELS;
  float own = own_visibility_fetch(pixel + ivec2(0, index * surface_position_size().y)).x;
  if (own >= 0.0) {
    return own;
  }
  vec4 known = cell_corners(cell, index);
  vec2 span = vec2(max(min(ivec2(RATE), surface_position_size() - 1 - cell * RATE), ivec2(1)));
  vec2 place = vec2(pixel - cell * RATE) / span;
  vec4 weights = vec4(1.0 - place.x, place.x, 1.0 - place.x, place.x) * vec4(vec2(1.0 - place.y), vec2(place.y));
  weights *= step(vec4(0.0), known);
  float whole = dot(weights, vec4(1.0));
  return (whole > 0.0) ? clamp(dot(weights, known) / whole, 0.0, 1.0) : max_component(vec3(max(known.x, known.y), known.zw));
}
