// Light of several bounces that media scatter towards the eye, from the grid along the view: at PLACES of each pixel's ray,
// drawn in proportion to what media there send back, the grid tells the light for each unit of their scattering.
#include "media/bins.glsl"
#include "media/view_ray.glsl"
#include "media/froxels.glsl"
#include "media/dither.glsl"

#define PLACES 12

struct Lit {
  vec3 found;
#ifdef SHINING
  vec3 straight;
#endif
  float known;
};

void lit_add(inout Lit lit, ivec3 cell, float weight)
{
  if (any(lessThan(cell, ivec3(0))) || any(greaterThanEqual(cell, froxel_shape.xyz))) {
    return;
  }
  vec4 found = froxel_light_fetch(froxel_texel(cell));
  lit.found += weight * found.rgb;
#ifdef SHINING
  lit.straight += weight * froxel_straight_fetch(froxel_texel(cell)).rgb;
#endif
  lit.known += weight * found.w;
}

Lit lit_at(vec3 place)
{
  Lit lit;
  lit.found = vec3(0.0);
#ifdef SHINING
  lit.straight = vec3(0.0);
#endif
  lit.known = 0.0;
  place.z = clamp(place.z, 0.5, float(froxel_shape.z) - 0.5);
  vec3 low = floor(place - 0.5);
  vec3 share = place - 0.5 - low;
  for (int k = 0; k < 8; k++) {
    ivec3 corner = ivec3(k & 1, (k >> 1) & 1, k >> 2);
    vec3 weight = mix(vec3(1.0) - share, share, vec3(corner));
    lit_add(lit, ivec3(low) + corner, weight.x * weight.y * weight.z);
  }
  if (lit.known < 0.02) {
    // All around lies behind surfaces or outside media: what is known near it.
    for (int k = 0; k < 27; k++) {
      ivec3 offset = ivec3(k % 3, (k / 3) % 3, k / 9) - 1;
      lit_add(lit, ivec3(floor(place)) + offset, 1e-3);
    }
  }
  return lit;
}

void main()
{
  out_indirect = vec4(0.0);
#ifdef SHINING
  out_direct = vec4(0.0);
#endif
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ViewRay ray = view_ray(surface_position_fetch(pixel), gl_FragCoord.xy);
  uint seed = roll_of(pixel, film_view.sample_index, film_view.seed, 49).x;
  media_asked_by(MEDIA_OF_CAMERA);
  media_bins(ray.origin, ray.direction, ray.limit, seed);
  if (!(bins.total > 0.0) || bins.count == 0) {
    return;
  }
  float own = fract(dither(pixel) + 0.618034 * float(film_view.sample_index));
  vec3 sum = vec3(0.0);
  vec3 straight = vec3(0.0);
  for (int n = 0; n < PLACES; n++) {
    int k;
    float t = bins_draw((float(n) + own) / float(PLACES), k);
    vec3 scattering;
    vec3 emission;
    media_at(bins.media[k], ray.origin + t * ray.direction, seed, scattering, emission);
    vec3 weight = layers_before(pixel, t) * bin_passing(k, t) * scattering / max(bins_density(k, t), 1e-30);
    if (max_component(weight) > 0.0) {
      Lit lit = lit_at(froxel_place(gl_FragCoord.xy, ray.before + t));
      float share = 1.0 / max(lit.known, 1e-30);
      sum += weight * lit.found * share;
#ifdef SHINING
      straight += weight * lit.straight * share;
#endif
    }
  }
  sum /= float(PLACES);
  out_indirect = vec4((is_finite(sum.x) && is_finite(sum.y) && is_finite(sum.z)) ? sum : vec3(0.0), 0.0);
#ifdef SHINING
  straight /= float(PLACES);
  bool whole = is_finite(straight.x) && is_finite(straight.y) && is_finite(straight.z);
  out_direct = vec4(whole ? straight : vec3(0.0), 0.0);
#endif
}
