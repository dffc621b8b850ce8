// Light straight from sources as it enters at points in glass, in place of what arrives along straight rays (coat.frag.glsl).
// `cell_across`: irradiance whatever its cosine, of light from above the point's horizon alone; `cell_around`: light at the places
// where other rays leave the glass (exit.frag.glsl), in `blocks`; `exits` rays of a point so far.
#include "lib/math.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 bent = cell_bent_fetch(texel);
  vec3 even = cell_across_fetch(texel).rgb * point_entry_fetch(texel).rgb / PI;
  vec3 entering = bent.x * even + bent.y * cell_direct_fetch(texel).rgb;
  vec3 around = vec3(0.0);
  for (int k = 0; k < blocks; k++) {
    around += cell_around_fetch(texel + ivec2(0, k * cell_bent_size().y)).rgb;
  }
  out_direct = vec4(max(entering, vec3(0.0)) + around / float(exits), 0.0);
}
