// Visibility of up to four lights at every RATE-th pixel of the picture along both axes.
#include "light/visibility_at.glsl"

void main()
{
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * RATE, surface_position_size() - 1);
  out_visibility = (surface_position_fetch(pixel).w == 0.0) ? vec4(0.0) : visibility_at(pixel);
}
