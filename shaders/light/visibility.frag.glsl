// Visibility of up to four lights, one in each channel, at every RATE-th pixel of the picture along both axes.
#include "lib/gbuffer.glsl"
#include "light/whole.glsl"
#include "generated/visibility"

void main()
{
  out_visibility = vec4(0.0);
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * RATE, surface_position_size() - 1);
  vec4 position = surface_position_fetch(pixel);
  if (position.w == 0.0) {
    return;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  out_visibility = vec4(1.0);
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    if ((light.flags & LIGHT_SHADOW) != 0) {
      out_visibility[i] = light_visibility(light, position.xyz, normal);
    }
  }
}
