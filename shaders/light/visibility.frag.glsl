// Visibility of up to four lights, one in each channel, at every RATE-th pixel of the picture along both axes.
// Leaves out media: visibility alone is found; the pass of light that reads it asks them.
// Leaves out links: likewise.
#include "light/visibility_at.glsl"

void main()
{
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * RATE, surface_position_size() - 1);
  out_visibility = vec4(0.0);
  int count = (surface_position_fetch(pixel).w == 0.0) ? 0 : light_count;
  for (int i = 0; i < count; i++) {
    out_visibility[i] = visibility_at(pixel, i);
  }
}
