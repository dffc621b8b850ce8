// Colour of a transparent layer over what lies behind it, to be multiplied into the surface images: the surface pass has
// already let the sample pass with the probability of the mean, so what is left is colour over mean. The order of layers
// does not matter. What was hit itself, or lies behind it, changes nothing.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"

void main()
{
  out_diffuse = vec4(1.0);
  out_tint = vec4(1.0);
  out_emission = vec4(1.0);
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
