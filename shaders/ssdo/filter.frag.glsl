// Mean over the 4x4 pixels whose random numbers are stratified together, of those that lie on the same surface.
#include "lib/gbuffer.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 size = textureSize(arriving, 0);
  out_arriving = texelFetch(arriving, pixel, 0);
  vec4 centre = texelFetch(surface_position, pixel, 0);
  if (centre.w == 0.0) {
    return;
  }
  vec3 normal = octahedral_decode(texelFetch(surface_normal, pixel, 0).xy);
  float depth = (film_view.eye.w > 0.5) ? 1.0 : distance(centre.xyz, film_view.eye.xyz);
  float pixel_size = (film_view.frame.y - film_view.frame.x) / film_view.film.x * depth;
  vec4 sum = vec4(0.0);
  float weight = 0.0;
  for (int y = -2; y < 2; y++) {
    for (int x = -2; x < 2; x++) {
      ivec2 other = pixel + ivec2(x, y);
      if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, size))) {
        continue;
      }
      vec4 position = texelFetch(surface_position, other, 0);
      vec3 facing = octahedral_decode(texelFetch(surface_normal, other, 0).xy);
      bool same = position.w != 0.0 && dot(normal, facing) > 0.8
                  && abs(dot(normal, position.xyz - centre.xyz)) < 2.0 * pixel_size;
      if (same || (x == 0 && y == 0)) {
        sum += texelFetch(arriving, other, 0);
        weight += 1.0;
      }
    }
  }
  out_arriving = sum / weight;
}
