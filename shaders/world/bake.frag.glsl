// Radiance of the world's tree by direction, as light sees it; layout as in lib/environment.glsl.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "generated/material"
#include "world/point.glsl"

void main()
{
  float azimuth = (0.5 - screen.x) * 2.0 * PI;
  float latitude = (screen.y - 0.5) * PI;
  vec3 direction = vec3(cos(latitude) * cos(azimuth), cos(latitude) * sin(azimuth), sin(latitude));
  out_radiance = vec4(world_radiance(direction, RAY_LIGHT), 1.0);
}
