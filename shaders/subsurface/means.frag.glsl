// Means of how materials scatter light below their surfaces: over a cell of pixels, each of which shows some point of one, for
// points that the camera does not see (surfaces/scatter_means.py). Bands of rows hold, one above the other, the length of the
// profile per channel, m, with the method; the colour that decides its shape, with the roughness of the interface, squared; and
// the share of the diffuse albedo that scatters, with the index of refraction.
#include "lib/gbuffer.glsl"
#include "subsurface/image.glsl"

void main()
{
  int band = int(gl_FragCoord.y) / rows;
  ivec2 corner = (ivec2(gl_FragCoord.xy) - ivec2(0, band * rows)) * ivec2(extent);
  vec3 sum = vec3(0.0);
  float last = 0.0;
  float count = 0.0;
  for (int y = 0; y < extent.y; y++) {
    for (int x = 0; x < extent.x; x++) {
      ivec2 pixel = corner + ivec2(x, y);
      vec4 share = scatter_share_fetch(pixel);
      if (share.w >= 4.0) {
        vec4 length_m = spread_length_fetch(pixel);
        vec4 entry = scatter_walk_fetch(pixel);
        sum += (band == 0) ? length_m.xyz : (band == 1) ? unpack_three(length_m.w, 255.0) : share.rgb;
        last = (band == 0) ? float(scatter_method(share.w)) : (band == 1) ? entry.x : entry.y;
        count += 1.0;
      }
    }
  }
  out_means = vec4(sum / max(count, 1.0), (count > 0.0) ? last : 0.0);
}
