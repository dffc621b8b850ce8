// Evaluates one material where rays have met it, into closures laid out as those of the surface pass.
//
// Of several lobes one is kept, by what the path that came here can bring of each (`met_path`, with PATH_COLOR): light that
// is green by now leaves a prism by the glass for green.
//
// What is transparent has been passed at random on the way, as opaque as its triangle is there (trace/hierarchy.glsl): what
// is met stands for all rays that were not.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/gbuffer.glsl"
#include "lib/instance.glsl"
#ifdef SHARED_VALUES
#include "hits/shared.glsl"

// Where the values of the material begin that is met here: an expression, since Metal has no globals.
#define MET_MATERIAL_BASE shared_base(int(hit_material_fetch(ivec2(gl_FragCoord.xy)).r + 0.5))
#endif
// Inside glass what it mirrors is no brighter than what it lets pass: asked for seldom, it would be grain.
#define LEAST_MIRRORED 0.05
// `glass_bends`: 2 and 4 keep smooth glass as one lobe of both ways; 3 and 4 frosted glass that is seen from within
// (hits/onward.glsl). add_glass asks for either where its roughness `r` is at most this:
#define SMOOTH_UP_TO 0.3  // rougher ones are followed both ways by the camera alone (lib/closure.glsl)
#define FROSTED_FROM 0.1  // as in hits/onward.glsl
#undef BOTH_ROUGHNESS
#define BOTH_ROUGHNESS 1.0
#define BOTH_WAYS ((r > FROSTED_FROM && ior < 1.0 && glass_bends >= 3) \
                   || (r <= SMOOTH_UP_TO && (glass_bends == 2 || glass_bends == 4)))
#include "generated/material"
#include "hits/point.glsl"
#ifdef OWN_SURFACE
#include "hits/relief.glsl"
#endif
#include "surface/store.glsl"

#define FIRST_EVEN 16  // as in surface/surface.frag.glsl
#define EVEN_SHARE 0.125

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int id = int(hit_triangle_fetch(pixel).x);
  SurfacePoint point = hit_point(pixel, instance_read(id), id);
  point.refracts = glass_bends != 0;
#ifdef OWN_SURFACE
  relief_at_hit(point);
#endif
  // Evenly over the samples: a pane's two sides are each one lobe of two.
  uvec3 salt = roll_of(pixel, 0, film_view.seed, 81 + ray_number);
  float even_share = (film_view.sample_index < FIRST_EVEN) ? 0.0 : EVEN_SHARE;
  Closures c = closures_begin(point.normal, shuffled(film_view.sample_index, salt.xy), even_share);
#ifdef PATH_COLOR
  if (path_known != 0) {
    vec3 path = met_path_fetch(pixel).rgb;
    float most = max_component(path);
    c.path = (most > 0.0 && is_finite(most)) ? path / most : vec3(1.0);
  }
#endif
  evaluate_material(point, c);
  closures_end(c);
  float through = clamp(dot(c.transparency, vec3(1.0 / 3.0)), 0.0, 1.0);
  store_closures(c, point, 1.0 / max(1.0 - through, 1e-2), 0.0, vec2(0.0));
}
