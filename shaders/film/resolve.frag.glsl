// The picture: the sum of all light paths. With a transparent film the world shows in its own pass only.
// generated/light_sums: vec3 direct_light(ivec2 pixel), vec3 indirect_light(ivec2 pixel),
// float seen_through_glass(ivec2 pixel) (addon/film/resolve.py)
#include "generated/light_sums"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 world = environment_fetch(pixel);
  vec3 sum = direct_light(pixel) + indirect_light(pixel) + emission_fetch(pixel).rgb;
  if (transparent == 0) {
    sum += world.rgb;
  }
  out_combined = vec4(sum * (scale * exposure), clamp((world.a - seen_through_glass(pixel)) * scale, 0.0, 1.0));
}
