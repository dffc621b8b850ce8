// Radiance that a material emits towards surfaces that it lights, to be added up over all that shows it from the front, or,
// where caster_sample is 1, from behind.
#include "surface/seen.glsl"

void main()
{
  bool behind;
  Closures c = closures_seen(light_point.xyz, RAY_LIGHT, behind);
  bool counts = behind == (caster_sample != 0) && is_finite(max_component(abs(c.emission)));
  out_emission = counts ? vec4(c.emission, 1.0) : vec4(0.0);
}
