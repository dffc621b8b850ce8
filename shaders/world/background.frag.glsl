// The world's tree behind all surfaces, as the camera sees it, through the coloured layers before it.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "ask/view.glsl"
#include "generated/material"
#include "world/point.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_radiance = vec4(0.0);
  if (surface_position_fetch(pixel).w == 0.0) {
    vec3 passed = surface_emission_fetch(pixel).rgb;
    out_radiance.rgb = world_radiance(view_direction(gl_FragCoord.xy), RAY_CAMERA) * passed;
  }
}
