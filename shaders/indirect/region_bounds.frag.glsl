// Which regions of pixels must be split: one level of the pyramid, out of the pixels (PIXELS) or out of the finer level.
//
//   low, high  least and largest depth (x) and normal (yzw) of the pixels in the region
//   flags      x: 1 if the region is split; y: 1 surfaces, 2 background or beyond the picture, 3 both
//
// A region is split where depth or normal differ too much within it, where a silhouette runs through it, at the border of
// the picture (what is interpolated ends there, what lights it does not), and where a neighbour is split down to its own
// finer level: neighbours then differ by one level at most.
#include "lib/math.glsl"

void main()
{
  ivec2 region = ivec2(gl_FragCoord.xy);
  out_low = vec4(1e30);
  out_high = vec4(-1e30);
  int kinds = 0;
#ifdef PIXELS
  for (int y = -1; y <= 1; y++) {  // one pixel before: an edge may run between two regions, and splits one of them
    for (int x = -1; x <= 1; x++) {
      ivec2 pixel = 2 * region + ivec2(x, y) - grid_offset;
      bool outside = any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, textureSize(surface_position, 0)));
      vec4 position = outside ? vec4(0.0) : texelFetch(surface_position, pixel, 0);
      if (position.w == 0.0) {
        kinds |= 2;
        continue;
      }
      float depth = dot(film_view.backward.xyz, film_view.eye.xyz - position.xyz);
      vec4 value = vec4(depth, octahedral_decode(texelFetch(surface_normal, pixel, 0).xy));
      out_low = min(out_low, value);
      out_high = max(out_high, value);
      kinds |= 1;
    }
  }
#else
  for (int child = 0; child < 4; child++) {
    ivec2 finer = 2 * region + ivec2(child & 1, child >> 1);
    out_low = min(out_low, texelFetch(finer_low, finer, 0));
    out_high = max(out_high, texelFetch(finer_high, finer, 0));
    kinds |= int(texelFetch(finer_flags, finer, 0).y);
  }
#endif
  bool split = kinds == 3;
  if ((kinds & 1) != 0) {
    float scale = (film_view.eye.w > 0.5) ? depth_scale : out_low.x;
    vec4 range = out_high - out_low;
    split = split || range.x > depth_step * scale || max_component(range.yzw) > normal_step;
  }
#ifndef PIXELS
  for (int y = -1; y <= 2; y++) {
    for (int x = -1; x <= 2; x++) {
      ivec2 finer = clamp(2 * region + ivec2(x, y), ivec2(0), textureSize(finer_flags, 0) - 1);
      split = split || texelFetch(finer_flags, finer, 0).x > 0.5;
    }
  }
#endif
  out_flags = vec2(split ? 1.0 : 0.0, float(kinds));
}
