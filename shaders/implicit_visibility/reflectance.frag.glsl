// How much of the light that meets a receiver it sends on, gloss counted as even.
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "indirect/albedo.glsl"

void main()
{
  out_reflectance = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  out_reflectance = vec4(clamp(surface_albedo(s, MEAN_COSINE), vec3(0.0), vec3(1.0)), 1.0);
}
