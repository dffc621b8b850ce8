// Colour and alpha of images, before and after interpolation, by Cycles' rules.
#include "lib/color.glsl"
#include "texture/levels.glsl"

// A stored texel as it enters the interpolation.
vec4 image_associate(vec4 texel, int flags)
{
  if ((flags & IMAGE_OPAQUE) != 0) {
    return vec4(texel.rgb, 1.0);
  }
  if ((flags & IMAGE_ASSOCIATE) != 0) {
    return vec4(texel.rgb * texel.a, texel.a);
  }
  return texel;
}

// The interpolated value as the node's outputs; colour stays multiplied by alpha unless alpha is used on its own.
vec4 image_finish(vec4 filtered, int flags, bool alpha_used)
{
  vec3 color = filtered.rgb;
  bool coverage = (flags & (IMAGE_ASSOCIATE | IMAGE_COVERAGE)) != 0;
  if (coverage && alpha_used && filtered.a > 0.0 && filtered.a < 1.0) {
    color /= filtered.a;
  }
  if ((flags & IMAGE_SRGB) != 0) {
    color = srgb_decode(color);
  }
  return vec4(color, filtered.a);
}

// What may be averaged of a node's outputs: where alpha is used, colour counts as far as it covers.
vec4 image_covered(vec4 found, int flags, bool alpha_used)
{
  bool coverage = alpha_used && (flags & (IMAGE_ASSOCIATE | IMAGE_COVERAGE)) != 0;
  return coverage ? vec4(found.rgb * clamp(found.a, 0.0, 1.0), found.a) : found;
}

// The node's outputs, from their mean.
vec4 image_uncovered(vec4 mean, int flags, bool alpha_used)
{
  bool coverage = alpha_used && (flags & (IMAGE_ASSOCIATE | IMAGE_COVERAGE)) != 0;
  return (coverage && mean.a > 0.0 && mean.a < 1.0) ? vec4(mean.rgb / mean.a, mean.a) : mean;
}
