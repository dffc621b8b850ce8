// A kernel over its whole sum, each channel for itself, without the core, which ends softly.
void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  float radius = length(vec2(texel - ivec2(reach)));
  float share = (core > 0.0) ? clamp((radius / core - 1.0) / 0.5, 0.0, 1.0) : 1.0;
  vec3 total = kernel_sum_fetch(ivec2(0)).rgb;
  // Nothing passes shut lids.
  vec3 weight = weights_fetch(texel).rgb / max(total, vec3(1e-30));
  out_weight = vec4(weight * (share * share * (3.0 - 2.0 * share)), 0.0);
}
