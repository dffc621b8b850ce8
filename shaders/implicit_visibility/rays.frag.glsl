// A short ray back to the surface that each receiver lies on, so that it is shaded as what rays meet (surfaces/hits.py).
#include "lib/math.glsl"
#include "implicit_visibility/surfels.glsl"

#define ABOVE 1e-3  // radii of a surfel

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int receiver = pixel.x + (pixel.y << RECEIVER_ROW);
  out_origin = vec4(0.0);
  out_direction = vec4(0.0);
  if (receiver >= receiver_count) {
    return;
  }
  int i = receiver * RECEIVER_TEXELS;
  vec4 place = receivers_fetch(ivec2(i & 2047, i >> 11));
  vec3 normal = receivers_fetch(ivec2((i + 1) & 2047, (i + 1) >> 11)).xyz;
  float above = max(ABOVE * place.w, 8.0 * offset_size);
  out_origin = vec4(place.xyz + above * normal, 0.5 * place.w);
  out_direction = vec4(-normal, 0.0);
}
