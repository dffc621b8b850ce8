// Colours of the layers that a pixel's sample has passed, as one, and how far along its view ray the nearest lies.
#include "ask/view.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 place = layer_place_fetch(pixel);
  vec3 direction = view_direction(gl_FragCoord.xy);
  float away = dot(place.xyz - view_origin(gl_FragCoord.xy), direction) - view_clip(direction);
  out_layers = vec4(layer_tint_fetch(pixel).rgb, (place.w != 0.0) ? away : 1e30);
}
