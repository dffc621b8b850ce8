// Light of lamps that media would scatter once towards the eye if nothing cast shadows and nothing were
// lost on the way to the places: where it peaks, by few places at even steps. What spreads light over pixels (spread.frag.glsl) divides by it.
//
// All pixels draw the same numbers, so that what the grids' cells make of them cancels in that. w: where media begin, for
// the colours of layers before them.
#define MEDIA_TURNS_APART
#include "media/asking.glsl"
#include "media/view_ray.glsl"

#define AROUND_PLACES 12  // around a lamp, fewer of each where there are many
#define FAR_PLACES 2     // of lights at infinity

void main()
{
  out_guide = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ViewRay ray = view_ray(surface_position_fetch(pixel), gl_FragCoord.xy);
  uint seed = roll_of(ivec2(0), film_view.sample_index, film_view.seed, 46).x;
  media_asked_by(MEDIA_OF_CAMERA);
  media_bins(ray.origin, ray.direction, ray.limit, seed);
  out_guide.w = (bins.count > 0) ? bins.from[0] : 0.0;
  if (!(bins.total > 0.0) || bins.count == 0) {
    return;
  }
  float begin = bins.from[0];
  float end = bins.to[bins.count - 1];
  vec3 sum = vec3(0.0);
  int around_places = clamp(48 / max(light_count - hidden_rows, 1) / 2 * 2, 4, AROUND_PLACES);
  for (int i = hidden_rows; i < light_count; i++) {
    Light light = light_read(i);
    bool round_ = LIGHT_IS(light, LIGHT_POINT) || LIGHT_IS(light, LIGHT_SPHERE);
    bool far = LIGHT_IS(light, LIGHT_SUN) || LIGHT_IS(light, LIGHT_DIRECTION);
    for (int n = 0; n < (far ? FAR_PLACES : around_places); n++) {
      // Points that stand for all of the lamp; of a round one, at their mean distance from its middle.
      float places = float(far ? FAR_PLACES : around_places);
      float v = (float(n) + 0.5) / places;
      vec2 u = vec2(fract(5.0 * v), fract(0.618034 * float(n)));
      Light part = light;
      part.point = round_ ? vec3(0.85 * light.radius, 0.0, 0.0) : light.point;
      part = light_at(part, u);
      int k;
      float t;
      float density;
      // Of places beside a lamp every other one goes where the media are: a thin plume lies between those around the lamp.
      Around around = around_row(i, u, ray.origin, ray.direction, begin, end);
      bool beside = around.exists && !far;
      float half_way = (float(n / 2) + 0.5) / (0.5 * places);
      if (beside && (n & 1) == 0) {
        t = around_draw(around, half_way);
        k = bins_find(t);
      }
      else {
        t = bins_draw(beside ? half_way : v, k);
      }
      if (k < 0) {
        continue;  // between media
      }
      density = bins_density(k, t);
      density = (beside ? 0.5 * (density + around_density(around, t)) : density) * places;
      vec3 position = ray.origin + t * ray.direction;
      vec3 direction;
      float per_steradian;
      vec3 found = light_sample(part, position, direction, per_steradian);
      found *= media_scattered(bins.media[k], position, -direction, -ray.direction, seed);
      sum += layers_before(pixel, t) * found * bin_passing(k, t) / max(density, 1e-30);
    }
  }
  out_guide.rgb = (is_finite(sum.x) && is_finite(sum.y) && is_finite(sum.z)) ? sum : vec3(0.0);
}
