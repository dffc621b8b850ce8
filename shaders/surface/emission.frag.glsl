// Radiance that a material emits towards surfaces that it lights, to be added up over all that shows it from the front, or,
// where sample_index is 1, from behind.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"

void main()
{
  SurfacePoint point = surface_point(light_point.xyz, instance_read(instance_flat.x));
  point.ray = RAY_LIGHT;
  Closures c = closures_begin(point.normal, 0.5);
  evaluate_material(point, c);
  closures_end(c);
  bool counts = point.backfacing == (sample_index != 0) && is_finite(max_component(abs(c.emission)));
  out_emission = counts ? vec4(c.emission, 1.0) : vec4(0.0);
}
