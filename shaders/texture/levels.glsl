// Where the levels of an image stand, and how their texels are stored. Level n has width >> n times height >> n texels, each
// the mean of an equal share of the image. It stands above the levels before it, 2^n of its rows side by side in each
// row of the texture, so that all levels together take a third more than the image, and no division finds a texel.
//
// Texels of level 0 are as the file has them. Those of others are means of linear light: of images that are stored with the
// sRGB curve as square roots, which eight bits hold better than the curve does; without alpha where level 0 is so.

#define IMAGE_SRGB 1       // stored with the sRGB curve
#define IMAGE_ASSOCIATE 2  // alpha is coverage and colour is stored without it
#define IMAGE_OPAQUE 4     // alpha is ignored
#define IMAGE_COVERAGE 8   // alpha is coverage, colour is stored with it
#define IMAGE_LEVELS 16    // the texture has room for levels

// The coarsest level: the last one that has texels.
int image_last_level(ivec2 whole)
{
  int side = min(whole.x, whole.y);
  int last = 0;
  while ((side >> (last + 1)) > 0) {
    last++;
  }
  return last;
}

// Width and height of a level of an image of size `whole`, and its first row in the texture.
ivec3 image_level(ivec2 whole, int number)
{
  int row = (number > 0) ? whole.y : 0;
  for (int before = 1; before < number; before++) {
    row += ((whole.y >> before) + (1 << before) - 1) >> before;
  }
  return ivec3(whole >> number, row);
}

// The place of a texel of a level in the texture.
ivec2 image_level_texel(ivec3 extent, int number, ivec2 texel)
{
  return ivec2(texel.x + (texel.y & ((1 << number) - 1)) * extent.x, extent.z + (texel.y >> number));
}

// What a texel of level 1 or coarser holds: linear light, multiplied by alpha where that is coverage.
vec4 image_from_level(vec4 texel, int flags)
{
  if ((flags & IMAGE_SRGB) != 0) {
    texel.rgb *= texel.rgb;
  }
  if ((flags & IMAGE_OPAQUE) != 0) {
    return vec4(texel.rgb, 1.0);
  }
  return ((flags & IMAGE_ASSOCIATE) != 0) ? vec4(texel.rgb * texel.a, texel.a) : texel;
}

vec4 image_to_level(vec4 mean, int flags)
{
  if ((flags & IMAGE_ASSOCIATE) != 0) {
    mean.rgb = (mean.a > 0.0) ? mean.rgb / mean.a : vec3(0.0);
  }
  return ((flags & IMAGE_SRGB) != 0) ? vec4(sqrt(max(mean.rgb, 0.0)), mean.a) : mean;
}
