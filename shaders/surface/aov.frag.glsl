// What AOV Output nodes of a material give at the surface that a pixel sees. As in Cycles a layer gives all of it, and
// what lies behind follows where the layer is less opaque than the threshold and this sample passes it: LAYERS adds such
// layers to what the first surface from the threshold on has drawn.
// generated/aovs: AOV_NONE and AOV_WRITE set the outputs, from functions of generated/material; Denoising Depth begins
// at AOV_NEAR.
#include "ask/view.glsl"
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/fragment.glsl"
#ifdef MOTION
#include "surface/motion.glsl"
#endif
#include "generated/aovs"

// How far a camera's ray goes to a place from where it begins.
float aov_distance(vec3 position)
{
  float depth = view_depth(position);
  return view_is_parallel(film_view.eye) ? depth - AOV_NEAR : view_distance(position) * (1.0 - AOV_NEAR / depth);
}

void main()
{
  AOV_NONE
  Instance instance;
  SurfacePoint point = fragment_point(instance);
  if (fragment_hidden(point.position, 1.0)) {
    discard;
  }
#ifdef WIDENS_STRANDS
  // Strands that are drawn wider than they are give something where the surface images have kept them.
  if (strand_missed || (strand_is_round() && !fragment_hidden(point.position, -1.0))) {
    discard;
  }
  gl_FragDepth = projected_depth(point.position, PROJECTION);
#endif
  point.refracts = true;
#ifdef LAYERED
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  bool thin = 1.0 - dot(c.transparency, vec3(1.0 / 3.0)) < alpha_threshold;
  if (thin != (layers != 0)) {
    discard;
  }
#endif
  float surface = (layers != 0) ? 0.0 : 1.0;  // passes of surfaces show no thin layers
  AOV_WRITE
}
