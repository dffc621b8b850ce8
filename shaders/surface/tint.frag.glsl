// Colour of a transparent layer over what lies behind it, to be multiplied into the surface images: the surface pass has
// already let the sample pass with the probability of the mean, so what is left is colour over mean. The order of layers
// does not matter. What was hit itself, or lies behind it, changes nothing.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/fragment.glsl"

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
  point.refracts = glass_bends != 0;
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
#ifdef ADDED_LOBES
  float mean = layer_chance(c);
#else
  float mean = dot(c.transparency, vec3(1.0 / 3.0));
#endif
  vec3 color = c.transparency / max(mean, 1e-20);
  if (mean <= 0.0 || min(color.x, min(color.y, color.z)) < 0.0) {
    discard;
  }
  out_diffuse = vec4(color, 1.0);
  out_tint = vec4(color, 1.0);
  out_emission = vec4(color, 1.0);
}
