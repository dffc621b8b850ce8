// Mean reflectance of a material: over a cell of pixels, each of which shows some point of it.
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "indirect/albedo.glsl"

void main()
{
  ivec2 corner = ivec2(gl_FragCoord.xy) * ivec2(cell);
  vec3 sum = vec3(0.0);
  float count = 0.0;
  for (int y = 0; y < cell.y; y++) {
    for (int x = 0; x < cell.x; x++) {
      ivec2 pixel = corner + ivec2(x, y);
      if (texelFetch(surface_position, pixel, 0).w != 0.0) {
        Surface s = SURFACE_READ(pixel);
        sum += surface_albedo(s, view_cosine);
        count += 1.0;
      }
    }
  }
  out_reflectance = vec4(sum / max(count, 1.0), count);
}
