// Radiance of a layer that emits and lets this sample pass, to be added to what the sample sees: fire, beams, holograms. Of
// what was hit the surface pass has it, and what lies behind that is hidden.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/fragment.glsl"

void main()
{
  out_emission = vec4(0.0);
  Instance instance;
  SurfacePoint point = fragment_point(instance);
  if (fragment_hidden(point.position, -1.0)) {
    discard;
  }
  if ((instance.flags & FLAG_HOLDOUT) != 0) {
    discard;
  }
  point.refracts = glass_bends != 0;
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  out_emission = vec4(c.emission, 0.0);
}
