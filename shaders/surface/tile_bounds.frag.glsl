// Bounds of the positions in a tile of pixels; w: least and greatest depth. Empty tiles give low > high.
#include "ask/view.glsl"
void main()
{
  ivec2 size = surface_position_size();
  ivec2 corner = ivec2(gl_FragCoord.xy) * tile;
  vec4 low = vec4(1e30);
  vec4 high = vec4(-1e30);
  for (int y = 0; y < tile; y++) {
    for (int x = 0; x < tile; x++) {
      ivec2 pixel = corner + ivec2(x, y);
      if (pixel.x < size.x && pixel.y < size.y) {
        vec4 position = surface_position_fetch(pixel);
        if (position.w != 0.0) {
          vec4 place = vec4(position.xyz, view_depth(position.xyz));
          low = min(low, place);
          high = max(high, place);
        }
      }
    }
  }
  out_low = low;
  out_high = high;
}
