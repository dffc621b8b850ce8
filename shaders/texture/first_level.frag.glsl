// Level 1 of an image out of the image itself: what lookups give between its texels, averaged in linear light.
//
// A lookup interpolates stored values and decodes after that, as Cycles does, which between black and white is darker than
// the mean of both. So the mean over a texel is taken of lookups: at the points of Gauss' rule with two points in each of the
// squares between texels' centres, which is exact up to the third power, and within .3 % for the sRGB curve from black to white.
#include "lib/math.glsl"
#include "lib/color.glsl"
#include "texture/levels.glsl"
#include "material/associate.glsl"

#define GAUSS 0.21132487  // of the way from a texel's centre to the next one

vec4 stored(ivec2 texel)
{
  // Beyond the border as where an image repeats: between -1 and the size.
  ivec2 at = level_part.xy + (texel + level_part.zw) % level_part.zw;
  vec4 found = texture_whole_fetch(at);
  bool good = is_finite(found.x) && is_finite(found.y) && is_finite(found.z) && is_finite(found.w);
  return image_associate(good ? found : vec4(0.0), level_flags);
}

// At the point left (`side` -1) or right (1) of a texel's centre, in its row or a next one.
vec4 beside(ivec2 texel, int side, int row)
{
  return mix(stored(texel + ivec2(0, row)), stored(texel + ivec2(side, row)), GAUSS);
}

vec4 finer_texel(ivec2 texel)
{
  vec4 sum = vec4(0.0);
  for (int side = -1; side < 2; side += 2) {
    vec4 middle = beside(texel, side, 0);
    for (int row = -1; row < 2; row += 2) {
      vec4 found = image_finish(mix(middle, beside(texel, side, row), GAUSS), level_flags, true);
      sum += 0.25 * image_covered(found, level_flags, true);
    }
  }
  return sum;
}

#include "texture/box.glsl"

void main()
{
  out_level = box_mean(ivec2(gl_FragCoord.xy), level_part.zw);
}
