// What pixels reflect of the irradiance of their regions.
#include "lib/math.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  bool there = surface_position_fetch(pixel).w != 0.0;
  vec3 reflected = max(surface_diffuse_fetch(pixel).rgb, vec3(0.0)) / PI * irradiance_fetch(pixel + grid_offset).rgb;
  out_diffuse = vec4(there ? reflected : vec3(0.0), 0.0);
}
