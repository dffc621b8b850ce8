// Which regions of pixels must be split: one level of the pyramid, out of the pixels (PIXELS) or out of the finer level.
//
//   low, high  least and largest depth (x) and normal (yzw) of the pixels in the region
//   flags      x: 1 if the region is split; y: 1 surfaces, 2 background or beyond the picture, 3 both
//
// A region is split where depth or normal differ too much within it, where a silhouette runs through it, at the border of
// the picture (what is interpolated ends there, what lights it does not), and where a neighbour is split down to its own
// finer level: neighbours then differ by one level at most.
#include "ask/view.glsl"
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
      bool outside = any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, surface_position_size()));
      vec4 position = outside ? vec4(0.0) : surface_position_fetch(pixel);
      if (position.w == 0.0) {
        kinds |= 2;
        continue;
      }
      float depth = view_depth(position.xyz);
      vec4 value = vec4(depth, octahedral_decode(surface_normal_fetch(pixel).xy));
      out_low = min(out_low, value);
      out_high = max(out_high, value);
      kinds |= 1;
    }
  }
#else
  for (int child = 0; child < 4; child++) {
    ivec2 finer = 2 * region + ivec2(child & 1, child >> 1);
    out_low = min(out_low, finer_low_fetch(finer));
    out_high = max(out_high, finer_high_fetch(finer));
    kinds |= int(finer_flags_fetch(finer).y);
  }
#endif
  bool split = kinds == 3;
  if ((kinds & 1) != 0) {
    float scale = view_is_parallel(film_view.eye) ? depth_scale : out_low.x;
    vec4 range = out_high - out_low;
    split = split || range.x > depth_step * scale || max_component(range.yzw) > normal_step;
  }
#ifndef PIXELS
  for (int y = -1; y <= 2; y++) {
    for (int x = -1; x <= 2; x++) {
      ivec2 finer = clamp(2 * region + ivec2(x, y), ivec2(0), finer_flags_size() - 1);
      split = split || finer_flags_fetch(finer).x > 0.5;
    }
  }
#endif
  out_flags = vec2(split ? 1.0 : 0.0, float(kinds));
}
