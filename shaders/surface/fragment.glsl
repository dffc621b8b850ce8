// The surface point of a fragment that the camera sees, and whether the surface images hide it.
#include "ask/view.glsl"
#include "surface/point.glsl"

// Where a material finds its surface itself, fragments that miss it end here.
SurfacePoint fragment_point(out Instance instance)
{
  vec3 incoming = view_toward(world_position);
  instance = instance_read(instance_flat.x);
  SurfacePoint point = surface_point(incoming, instance);
#ifdef OWN_SURFACE
  if (!own_surface(point, instance)) {
    discard;
  }
  gl_FragDepth = projected_depth(point.position, PROJECTION);
#endif
  return point;
}

// Whether a place is not seen: beyond the clip distances, or behind what the surface images show. Interpolated positions
// of one point differ by some units of the last place between two programs: `slack` 1 counts such a place as seen, -1 as
// hidden.
bool fragment_hidden(vec3 position, float slack)
{
  float depth = view_depth(position);
  vec4 hit = surface_position_fetch(ivec2(gl_FragCoord.xy));
  float hit_depth = view_depth(hit.xyz);
  bool behind = hit.w != 0.0 && depth > hit_depth + slack * 1e-6 * (abs(hit_depth) + length(hit.xyz - film_view.eye.xyz));
  return behind || depth < film_view.film.z || depth > film_view.film.w;
}
