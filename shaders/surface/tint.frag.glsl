// Colour of a transparent layer over what lies behind it, to be multiplied into the surface images: the surface pass has
// already let the sample pass with the chance of the layer, so what is left is colour over chance. The order of layers
// does not matter. What was hit itself, or lies behind it, changes nothing.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/fragment.glsl"
#include "surface/layer.glsl"

void main()
{
  out_diffuse = vec4(1.0);
  out_tint = vec4(1.0);
  out_emission = vec4(1.0);
  Instance instance;
  SurfacePoint point = fragment_point(instance);
  if (fragment_hidden(point.position, -1.0)) {
    discard;
  }
  Closures c;
  vec3 color;
  if (!layer_color(point, instance, c, color)) {
    discard;
  }
  out_diffuse = vec4(color, 1.0);
  out_tint = vec4(color, 1.0);
  out_emission = vec4(color, 1.0);
}
