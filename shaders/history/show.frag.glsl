// Indirect light as it is shown: where few pictures stand behind it, of more neighbours, and where many do, the pixel's own.
#include "lib/math.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec3 color = surface_diffuse_fetch(pixel).rgb;
  vec3 fresh = fresh_indirect_fetch(pixel).rgb;
  float count = before_facing_fetch(pixel).z;
  vec3 light = mix(farther_fetch(pixel).rgb, nearer_fetch(pixel).rgb, clamp((count - 2.0) / 6.0, 0.0, 1.0));
  light = mix(light, before_indirect_fetch(pixel).rgb, clamp((count - 8.0) / 16.0, 0.0, 1.0));
  vec3 shown = vec3((color.r > 1e-3) ? light.r * color.r : fresh.r, (color.g > 1e-3) ? light.g * color.g : fresh.g,
                    (color.b > 1e-3) ? light.b * color.b : fresh.b);
  out_light = vec4((count > 0.0) ? shown : fresh, 0.0);
}
