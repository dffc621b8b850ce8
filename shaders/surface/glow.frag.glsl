// Radiance of a layer that emits and lets this sample pass, to be added to what the sample sees: fire, beams, holograms. Of
// what was hit the surface pass has it, and what lies behind that is hidden.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"

void main()
{
  out_emission = vec4(0.0);
  vec3 eye = film_view.eye.xyz;
  vec3 incoming = (film_view.eye.w > 0.5) ? film_view.backward.xyz : safe_normalize(eye - world_position);
  Instance instance = instance_read(instance_flat.x);
  SurfacePoint point = surface_point(incoming, instance);
#ifdef OWN_SURFACE
  if (!own_surface(point, instance)) {
    discard;
  }
  gl_FragDepth = projected_depth(point.position, PROJECTION);
#endif
  float depth = dot(eye - point.position, film_view.backward.xyz);
  vec4 hit = surface_position_fetch(ivec2(gl_FragCoord.xy));
  float hit_depth = dot(eye - hit.xyz, film_view.backward.xyz);
  // Interpolated positions of one point differ by some units of the last place between two programs.
  bool behind = hit.w != 0.0 && depth >= hit_depth - 1e-6 * (abs(hit_depth) + length(hit.xyz - eye));
  if (behind || depth < film_view.film.z || depth > film_view.film.w) {
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
