// Writes what leaves points, and where these lie, into the list that subsurface/leaving.glsl reads.
#include "lib/math.glsl"
#include "subsurface/image.glsl"

void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy) - ivec2(0, 1);
  int index = place.y * 2048 + place.x;
  int cell = index >> 2;
  ivec2 texel = ivec2(cell & (ROW - 1), cell / ROW);
  out_texel = vec4(0.0);
  if (texel.y >= cell_sent_size().y) {
    return;
  }
  int kind = index & 3;
  out_texel = (kind == 0) ? cell_sent_fetch(texel) : (kind == 1) ? cell_part_fetch(texel)
            : (kind == 2) ? cell_same_fetch(texel) : point_position_fetch(texel);
}
