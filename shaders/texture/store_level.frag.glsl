// Puts a level to its place in the texture.
#include "texture/levels.glsl"

void main()
{
  ivec3 own = image_level(level_part.zw, level_number);
  ivec2 at = ivec2(gl_FragCoord.xy) - level_part.xy - ivec2(0, own.z);
  int side_by_side = at.x / own.x;
  ivec2 texel = ivec2(at.x - side_by_side * own.x, (at.y << level_number) + side_by_side);
  bool there = side_by_side < (1 << level_number) && texel.y < own.y;
  out_texel = there ? image_to_level(level_mean_fetch(texel), level_flags) : vec4(0.0);
}
