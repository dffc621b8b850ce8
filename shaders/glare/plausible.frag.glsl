// The picture as far as it may dazzle: where light arrives by way of other surfaces, a pixel counts for at most
// `most_contrast` times the fourth brightest of the 24 others of its 5x5. A sample's light goes to four pixels at most
// (a pixel filter of 1.5 pixels), so that one lucky path lifts no more than the three above the fourth. What is seen
// straight (emission, the world, lamps in one reflection) counts as it is.
#include "glare/excess.glsl"

vec3 seen_straight(ivec2 pixel)
{
  return scale * (finite_light(emission_fetch(pixel).rgb) + finite_light(reflected_fetch(pixel).rgb)
                  + world * finite_light(environment_fetch(pixel).rgb));
}

vec3 by_way_of_others(ivec2 pixel)
{
  return max(finite_light(picture_fetch(pixel).rgb) - seen_straight(pixel), vec3(0.0));
}

float fourth_around(ivec2 pixel)
{
  vec4 brightest = vec4(0.0);  // in falling order
  for (int j = -2; j <= 2; j++) {
    for (int i = -2; i <= 2; i++) {
      ivec2 other = pixel + ivec2(i, j);
      if ((i == 0 && j == 0) || any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, picture_size()))) {
        continue;
      }
      float light = max_component(by_way_of_others(other));
      vec4 lower = min(brightest, vec4(light));
      brightest = max(brightest, vec4(light, lower.xyz));
    }
  }
  return brightest.w;
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 seen = picture_fetch(pixel);
  vec3 found = by_way_of_others(pixel);
  float peak = max_component(found);
  float most = (peak > white) ? max(most_contrast * fourth_around(pixel), white) : peak;
  out_plausible = vec4(finite_light(seen.rgb) - found * (1.0 - min(most / max(peak, DARK), 1.0)), seen.a);
}
