// Depth along the camera axis; Blender's value for "nothing" is 1e10.
#include "ask/view.glsl"
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = surface_position_fetch(pixel);
  out_depth = vec4(position.w != 0.0 ? view_depth(position.xyz) : 1e10);
}
