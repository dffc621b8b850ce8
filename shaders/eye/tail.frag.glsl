// A kernel over its whole sum, each channel for itself, with no more light in its core than there is at the core's rim.
void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  float radius = length(vec2(texel - ivec2(reach)));
  float share = (core > 0.0) ? clamp((radius / core - 1.0) / (rim - 1.0), 0.0, 1.0) : 1.0;
  share = share * share * (3.0 - 2.0 * share);
  vec3 total = kernel_sum_fetch(ivec2(0)).rgb;
  // Nothing passes shut lids.
  vec3 beneath = rim_sum_fetch(ivec2(0)).rgb * per_rim_texel;
  out_weight = vec4(mix(beneath, weights_fetch(texel).rgb, share) / max(total, vec3(1e-30)), 0.0);
}
