// Surface pass: evaluates the material and stores its closures. Transparency is stochastic: a layer is drawn with the
// probability of its opacity, so that the mean over samples is exact alpha blending.
#include "ask/view.glsl"
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/gbuffer.glsl"
#include "lib/instance.glsl"
// `glass_bends`: 1 and 2 as of draw_surfaces; 4 beside either keeps thin coats beside the lobe below them.
#define BOTH_WAYS ((glass_bends & 3) == 2)
#define COAT_APART ((glass_bends & 4) != 0)
#include "generated/material"
#include "surface/point.glsl"
#include "surface/store.glsl"

// Pictures of few samples are about all light together, and lobes in proportion to their light serve that best.
#define FIRST_EVEN 16
#define EVEN_SHARE 0.125

void main()
{
  vec3 incoming = view_toward(world_position);
  Instance instance = instance_read(instance_flat.x);
  SurfacePoint point = surface_point(incoming, instance);
#ifdef OWN_CLOSURES
  OwnHit own;  // what the surface is there, beside where
  if (!own_hit(point, instance, own)) {
    discard;
  }
  gl_FragDepth = projected_depth(point.position, PROJECTION);
#elif defined(OWN_SURFACE)
  if (!own_surface(point, instance)) {
    discard;
  }
  gl_FragDepth = projected_depth(point.position, PROJECTION);
#endif
  float depth = view_depth(point.position);
  if (depth < film_view.film.z || depth > film_view.film.w) {
    discard;
  }
  point.refracts = (glass_bends & 3) != 0;

  uvec3 bits = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(instance_flat.x) * 9781u + uint(film_view.seed)));
  uvec3 layer = hash3(uvec3(bits.x, uint(gl_PrimitiveID), bits.y));
#ifdef WIDENS_STRANDS
  if (strand_missed) {
    discard;
  }
  gl_FragDepth = projected_depth(point.position, PROJECTION);
#endif
  float even_share = (film_view.sample_index < FIRST_EVEN) ? 0.0 : EVEN_SHARE;
#ifdef ONE_LOBE
  Closures c = closures_begin(point.normal, lobe_choice, 0.0);
#else
  Closures c = closures_begin(point.normal, scrambled(film_view.bits_w, bits.z), even_share);
#endif
  evaluate_material(point, c);
  closures_end(c);
#ifdef OWN_CLOSURES
  own_closures(c, point, own);
#endif

  bool cuts = (instance.flags & FLAG_HOLDOUT) != 0;
  float through = layer_chance(c, (transparent_mode < 0 || transparent_mode > 2) && !cuts);
  // transparent_mode 0: stochastic; -1: that, before surface/tint.frag.glsl colours what passes; 1: draw as
  // opaque; 2: leave out (the two ends between which all layers lie); from 3 on: as -1, but opaque from so many thousandths
  // of opacity on, as passes of data have it.
  bool passes = (transparent_mode != 2) ? shuffled(film_view.sample_index, layer.xy) < through : through > 0.0;
  if (transparent_mode > 2 && 1.0 - dot(c.transparency, vec3(1.0 / 3.0)) >= float(transparent_mode - 3) * 1e-3 - 1e-5) {
    passes = false;
  }
  if (transparent_mode != 1 && passes) {
    discard;
  }
  float covered = (transparent_mode <= 0) ? 1.0 / max(1.0 - through, 1e-4) : 1.0;
  float holdout = clamp(c.holdout * covered, 0.0, 1.0);
  // It cuts its hole in what the camera sees; other views ask for what the object reflects, which lights others.
  if (cuts && film_view.visibility == FLAG_CAMERA) {
    holdout = 1.0;
    covered = 0.0;
  }

#ifdef OWN_SURFACE
  vec2 lift = vec2(0.0);
#else
  vec2 lift = (instance_terminator(instance_flat.x) > 0.0) ? smooth_lift(instance, point.backfacing) : vec2(0.0);
#endif
  store_closures(c, point, covered, holdout, lift);
#ifdef OWN_CLOSURES
  own_store(point, own);
#endif
  if (index_shown >= 0) {
    out_position = vec4(point.object_index, float(index_shown), float(instance_flat.x), 1.0);
  }
}
