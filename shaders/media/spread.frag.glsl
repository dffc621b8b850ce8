// Light of media at every `stride`-th pixel brought to all pixels: the mean over 4 x 4 of the known ones around, which have
// all 16 numbers of the dither among them, of those whose ray ends about as far away and is hidden about as much.
//
// What is spread is light over what is known at each pixel: opacity, so that outlines of media and their detail stay sharp,
// and what lamps would send without shadows (guide.frag.glsl), so that peaks around them stay where they are, and colours
// of layers on their side of an outline.
#include "media/media.glsl"
#include "media/view_ray.glsl"

#define REACH 2.0
#define MOST_TIMES 8.0  // what is known around, for as much as there is of media: more is a guide that has missed it there, at the rim of a cloud

float overlap(float place, float middle)
{
  return clamp(min(place + 0.5, middle + REACH) - max(place - 0.5, middle - REACH), 0.0, 1.0);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 size = coarse_direct_size();
  ViewRay ray = view_ray(surface_position_fetch(pixel), gl_FragCoord.xy);
  uint salt = roll_of(pixel, film_view.sample_index, film_view.seed, 45).x;
  media_asked_by(MEDIA_OF_CAMERA);
  vec3 passing = media_transmittance_asked(ray.origin, ray.direction, ray.limit, salt);
  float opacity = 1.0 - dot(passing, vec3(1.0 / 3.0));
  float own = min(ray.limit, 1e18);
  vec2 middle = (vec2(pixel) - vec2(shown_pixel)) / float(stride);
  ivec2 corner = ivec2(floor(middle + 0.5));
  vec4 direct = vec4(0.0);
  vec4 emission = vec4(0.0);
  float total = 0.0;
  float known_opacity = 0.0;
  vec3 guided = vec3(0.0);
  vec3 guides = vec3(0.0);
  vec3 most = vec3(0.0);
  vec4 guide = airlight_guide_fetch(pixel);
  vec3 here = guide.rgb;
  ivec2 last = airlight_guide_size() - 1;
  for (int y = -2; y <= 2; y++) {
    for (int x = -2; x <= 2; x++) {
      ivec2 known = corner + ivec2(x, y);
      ivec2 other = clamp(known, ivec2(0), size - 1);
      vec4 found = coarse_direct_fetch(other);
      vec4 second = coarse_emission_fetch(other);
      float apart = abs(found.w - own) / max(max(found.w, own), 1e-30);
      float hidden = abs(second.w - opacity) / max(max(second.w, opacity), 1e-6);
      float like = max(1.0 - 8.0 * apart, 0.0) * max(1.0 - 2.0 * hidden, 0.0) + 1e-4;
      float weight = like * overlap(float(known.x), middle.x) * overlap(float(known.y), middle.y);
      direct += weight * found;
      emission += weight * second;
      known_opacity += weight * second.w;
      // Shares of light, each as good as the next one: a peak among them must not outweigh all, nor a share of nothing.
      vec3 there = airlight_guide_fetch(min(other * stride + shown_pixel, last)).rgb;
      vec3 trust = weight / max(there + here, vec3(1e-20));
      guided += trust * found.rgb;
      guides += trust * there;
      most = max(most, (weight > 0.0) ? abs(found.rgb) * min(opacity / max(second.w, 1e-6), 1.0) : vec3(0.0));
      total += weight;
    }
  }
  float share = (known_opacity > 0.0) ? opacity / known_opacity : 0.0;
  // What no place of the guide has met stays where it is.
  ivec2 nearest = clamp(ivec2(floor(middle + 0.5)), ivec2(0), size - 1);
  vec3 stays = coarse_direct_fetch(nearest).rgb * opacity / max(coarse_emission_fetch(nearest).w, 1e-30);
  vec3 spread = mix(stays, guided * here / max(guides, vec3(1e-30)), greaterThan(guides, vec3(0.0)));
  out_direct = vec4(clamp(spread, -MOST_TIMES * most, MOST_TIMES * most), 0.0);
  // Thin fire hides nothing and still shines.
  float evenly = 1.0 / max(total, 1e-30);
  out_emission = vec4(layers_before(pixel, guide.w) * emission.rgb * ((opacity > 1e-3) ? share : evenly), 0.0);
}
