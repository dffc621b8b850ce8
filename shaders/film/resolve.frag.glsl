// The picture: the sum of all light paths. With a transparent film the world shows in its own pass only.
// generated/light_sums: vec3 direct_light(ivec2 pixel), vec3 indirect_light(ivec2 pixel),
// float seen_through_glass(ivec2 pixel), vec4 seen_emission(ivec2 pixel), vec4 seen_environment(ivec2 pixel), and of all
// that is not held apart vec4 seen_together(ivec2 pixel) (addon/film/resolve.py)
#include "generated/light_sums"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 world = seen_environment(pixel);
  vec4 summed = seen_together(pixel);
  vec3 sum = direct_light(pixel) + indirect_light(pixel) + seen_emission(pixel).rgb;
  if (transparent == 0) {
    sum += world.rgb;
  }
  sum += summed.rgb;
  float coverage = world.a + summed.a - seen_through_glass(pixel);
  out_combined = vec4(sum * (scale * exposure), clamp(coverage * scale, 0.0, 1.0));
}
