// A record as a quad around its footprint (addon/kernels/splats.py). Empty records are clipped.
#include "lib/projection.glsl"

void main()
{
  ivec2 place = ivec2(gl_InstanceID % splat_columns, gl_InstanceID / splat_columns);
  splat_centre = splat_centres_fetch(place);
  splat_first = vec4(0.0);
  splat_second = vec4(0.0);
  splat_value = vec4(0.0);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (splat_centre.w != 0.0) {
    splat_first = splat_firsts_fetch(place);
    splat_second = splat_seconds_fetch(place);
    splat_value = splat_values_fetch(place);
    vec3 at = splat_centre.xyz + corner.x * splat_first.xyz + corner.y * splat_second.xyz;
    gl_Position = project(at, PROJECTION);
  }
}
