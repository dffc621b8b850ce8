// The picture, what dazzles lessened by its scattered share, and what scatters to here from elsewhere.
#include "glare/excess.glsl"

vec3 scattered_at(vec2 pixel)
{
#if FACTOR == 1
  return scattered_fetch(ivec2(pixel)).rgb;
#else
  // Bilinear between the middles of FACTOR x FACTOR pixels; at the borders the outermost are meant.
  vec2 place = pixel / float(FACTOR) - 0.5;
  ivec2 first = ivec2(floor(place));
  vec2 between = place - floor(place);
  ivec2 last = (picture_size() + FACTOR - 1) / FACTOR - 1;
  ivec2 low = clamp(first, ivec2(0), last);
  ivec2 high = clamp(first + 1, ivec2(0), last);
  vec3 below = mix(scattered_fetch(low).rgb, scattered_fetch(ivec2(high.x, low.y)).rgb, between.x);
  vec3 above = mix(scattered_fetch(ivec2(low.x, high.y)).rgb, scattered_fetch(high).rgb, between.x);
  return mix(below, above, between.y);
#endif
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 seen = picture_fetch(pixel);
  vec3 sum = share_fetch(ivec2(0)).rgb;
  vec3 lost = min(strength * sum, vec3(1.0));
  vec3 factor = lost / max(sum, vec3(1e-30));
  vec3 light = finite_light(seen.rgb) - lost * excess_of(dazzling_fetch(pixel).rgb, white, most_light);
  light += factor * max(scattered_at(gl_FragCoord.xy), vec3(0.0));
  out_combined = vec4(dimming * max(light, vec3(0.0)), is_finite(seen.a) ? seen.a : 1.0);
}
