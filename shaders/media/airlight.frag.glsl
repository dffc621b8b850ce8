// Light that media scatter once towards the eye, and that they emit: places on the view ray times points of lights.
//
// Places are drawn half around the light's point, in equal steps of the angle under which it sees the ray (Kulla & Fajardo
// 2012), half in proportion to what the medium sends back (media/bins.glsl), both weighted by the balance heuristic. One
// row of `sources` after the other takes `places` of them, stratified; STRIDE pixels of the picture share one of this.
#include "media/arriving.glsl"
#include "media/view_ray.glsl"
#include "media/dither.glsl"

void main()
{
  out_direct = vec4(0.0);
  out_emission = vec4(0.0);
  ivec2 size = surface_position_size();
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * STRIDE + shown_pixel, size - 1);
  ViewRay ray = view_ray(surface_position_fetch(pixel), vec2(pixel) + 0.5);
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 43);
  uint seed = roll.x;
  Bins bins = media_bins(ray.origin, ray.direction, ray.limit, seed);
#if STRIDE > 1
  out_direct.w = min(ray.limit, 1e18);  // for what spreads this over the pixels around
#endif
  out_emission.rgb = bins.emitted;
#if STRIDE > 1
  out_emission.w = 1.0 - dot(bins.end, vec3(1.0 / 3.0));
#endif
  if (!(bins.total > 0.0) || bins.count == 0) {
    return;
  }
  float begin = bins.from[0];
  float end = bins.to[bins.count - 1];
  vec3 sum = vec3(0.0);
  for (int i = 0; i < ROWS_ASKED; i++) {
    uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed * 64 + i)));
#if STRIDE > 1
    float own = fract(dither(ivec2(gl_FragCoord.xy)) + 0.618034 * float(film_view.sample_index) + 0.7548777 * float(i));
#else
    float own = shuffled(film_view.sample_index, salt.xy);
#endif
    bool far = true;
    vec3 point = ray.origin;
    if (i < light_count) {
      Light light = light_read(i);
      far = LIGHT_IS(light, LIGHT_SUN) || LIGHT_IS(light, LIGHT_DIRECTION);
      point = (LIGHT_IS(light, LIGHT_POINT) || LIGHT_IS(light, LIGHT_SPHERE)) ? light.centre : light.point;
    }
    float middle = dot(point - ray.origin, ray.direction);
    vec3 missed = ray.origin + middle * ray.direction - point;
    float apart = max(length(missed), 1e-6 * max(abs(middle), 1e-3));
    float low = atan((begin - middle) / apart);
    float high = atan((min(end, 1e15) - middle) / apart);
    float opening = high - low;
    bool around = !far && opening > 1e-7;
    vec3 own_sum = vec3(0.0);
    for (int n = 0; n < places; n++) {
      // Both ways to draw take turns, each stratified by itself; a single place draws which.
      bool by_angle = around && ((places > 1) ? (n & 1) == 0 : own < 0.5);
      float v = (float(n) + own) / float(places);
      if (around) {
        v = (places > 1) ? (float(n / 2) + fract(own + (by_angle ? 0.0 : 0.5))) / float(places / 2) : fract(2.0 * own);
      }
      float t;
      int k;
      if (by_angle) {
        t = clamp(middle + apart * tan(mix(low, high, v)), begin, end);
        k = bins_find(bins, t);
        if (k < 0) {
          continue;
        }
      }
      else {
        t = bins_draw(bins, v, k);
      }
      float density = bins_density(bins, k, t);
      if (around) {
        float off = t - middle;
        density = 0.5 * density + 0.5 * apart / (opening * (off * off + apart * apart));
      }
      vec3 position = ray.origin + t * ray.direction;
      vec3 weight = bin_passing(bins, k, t) / max(density, 1e-30);
      uint own_salt = seed + uint(i * 64 + n);
      uvec3 turn = hash3(salt + uint(n) * 3u);
      vec2 u = vec2(scrambled(film_view.bits_x, turn.x), scrambled(film_view.bits_y, turn.y));
      Asked asked = ask_scattered(i, bins.media[k], position, -ray.direction, u, own_salt);
      own_sum += weight * asked_arriving(asked, position, own_salt);
    }
    sum += own_sum / float(places);
  }
  bool finite_sum = is_finite(sum.x) && is_finite(sum.y) && is_finite(sum.z);
  out_direct.rgb = finite_sum ? sum : vec3(0.0);
}
