// A level out of the finer one before it.
vec4 finer_texel(ivec2 texel)
{
  return finer_level_fetch(texel);
}

#include "texture/box.glsl"

void main()
{
  out_level = box_mean(ivec2(gl_FragCoord.xy), finer_extent);
}
