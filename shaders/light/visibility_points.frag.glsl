// Visibility of up to four lights, one in each channel, at the pixels 2^point_bits apart.
#include "lib/gbuffer.glsl"

void main()
{
  ivec2 size = surface_position_size();
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) << point_bits, size - 1);
  out_visibility = vec4(0.0);
  for (int i = 0; i < light_count; i++) {
    out_visibility[i] = pixel_visibility_fetch(pixel + ivec2(0, i * size.y)).x;
  }
}
