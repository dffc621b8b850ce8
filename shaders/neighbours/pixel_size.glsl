// Width of a pixel at a point that is seen, in the scene's units.
#include "ask/view.glsl"
float pixel_size_at(vec3 position)
{
  return view_pixel() * view_growth(position);
}
