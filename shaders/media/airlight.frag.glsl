// Light that media scatter once towards the eye, and that they emit: places on the view ray times points of lights.
//
// Places are drawn half around the light's point, in equal steps of the angle under which it sees the ray (Kulla & Fajardo
// 2012), half in proportion to what the medium sends back (media/bins.glsl), both weighted by the balance heuristic. One
// row of `sources` after the other takes `places` of them, stratified. Of every `stride`-th pixel, whose light is spread where that is above 1.
// AT_HITS: of rays that mirrors and glass send on, up to what those have met, instead of the camera's.
#include "media/arriving.glsl"
#ifdef AT_HITS
#include "media/lobe_ray.glsl"
#else
#include "media/view_ray.glsl"
#endif
#include "media/dither.glsl"

void main()
{
#ifdef AT_HITS
  show_nothing();
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ViewRay ray;
  int asks;
  if (!lobe_ray(pixel, ray, asks)) {
    return;
  }
  media_asked_by(asks);
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 181 + ray_number);
#else
  out_direct = vec4(0.0);
  out_emission = vec4(0.0);
  ivec2 size = surface_position_size();
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * stride + shown_pixel, size - 1);
  ViewRay ray = view_ray(surface_position_fetch(pixel), vec2(pixel) + 0.5);
  media_asked_by(MEDIA_OF_CAMERA);
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 43);
#endif
  uint seed = roll.x;
  media_bins(ray.origin, ray.direction, ray.limit, seed);
#ifdef AT_HITS
  show(pixel, vec3(0.0), bins.emitted);
#else
  out_emission.rgb = bins.emitted;
  if (stride > 1) {
    out_direct.w = min(ray.limit, 1e18);  // for what spreads this over the pixels around, and colours what media emit
    out_emission.w = 1.0 - dot(bins.end, vec3(1.0 / 3.0));
  }
  else if (bins.count > 0) {
    out_emission.rgb *= layers_before(pixel, bins.from[0]);
  }
#endif
  if (!(bins.total > 0.0) || bins.count == 0) {
    return;
  }
  float begin = bins.from[0];
  float end = bins.to[bins.count - 1];
  vec3 sum = vec3(0.0);
  for (int i = hidden_rows; i < ROWS_ASKED; i++) {
#ifdef AT_HITS
    uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed * 64 + i + 8192 * (1 + ray_number))));
#else
    uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed * 64 + i)));
#endif
    float dithered = dither(ivec2(gl_FragCoord.xy)) + 0.618034 * float(film_view.sample_index) + 0.7548777 * float(i);
    float own = (stride > 1) ? fract(dithered) : shuffled(film_view.sample_index, salt.xy);
    vec2 lamp_turn = vec2(scrambled(film_view.bits_x, salt.y), scrambled(film_view.bits_y, salt.z));
    Around around = around_row(i, lamp_turn, ray.origin, ray.direction, begin, end);
    vec3 own_sum = vec3(0.0);
    for (int n = 0; n < places; n++) {
      // Both ways to draw take turns, each stratified by itself; a single place draws which.
      bool by_angle = around.exists && ((places > 1) ? (n & 1) == 0 : own < 0.5);
      float v = (float(n) + own) / float(places);
      if (around.exists) {
        v = (places > 1) ? (float(n / 2) + fract(own + (by_angle ? 0.0 : 0.5))) / float(places / 2) : fract(2.0 * own);
      }
      float t;
      int k;
      if (by_angle) {
        t = around_draw(around, v);
        k = bins_find(t);
        if (k < 0) {
          continue;
        }
      }
      else {
        t = bins_draw(v, k);
      }
      float density = bins_density(k, t);
      if (around.exists) {
        density = 0.5 * (density + around_density(around, t));
      }
      vec3 position = ray.origin + t * ray.direction;
      vec3 weight = layers_before(pixel, t) * bin_passing(k, t) / max(density, 1e-30);
      uint own_salt = seed + uint(i * 64 + n);
      uvec3 turn = hash3(salt + uint(n) * 3u);
      vec2 u = vec2(scrambled(film_view.bits_x, turn.x), scrambled(film_view.bits_y, turn.y));
      u = (i >= light_count || around.round_lamp) ? u : lamp_turn;
      Asked asked = ask_scattered(i, bins.media[k], position, -ray.direction, u, own_salt);
      own_sum += weight * asked_arriving(asked, position, own_salt);
    }
    sum += own_sum / float(places);
  }
  bool finite_sum = is_finite(sum.x) && is_finite(sum.y) && is_finite(sum.z);
#ifdef AT_HITS
  show(pixel, finite_sum ? sum : vec3(0.0), bins.emitted);
#else
  out_direct.rgb = finite_sum ? sum : vec3(0.0);
#endif
}
