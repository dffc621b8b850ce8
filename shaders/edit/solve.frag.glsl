// The edit by itself, at the places of an image, for directions of another one: what it costs and whether it is right.
float distance_layer(int k)
{
  return 0.0;
}

#include "edit/solve.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_edit = edited_rotation(places_fetch(pixel).xyz, directions_fetch(pixel).xyz, false);
}
