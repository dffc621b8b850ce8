// Radiance that gloss at the points of a node sends towards a direction (micro/lobes.frag.glsl), from `index`, side and node.
// `blur`: variance of directions along each axis, rad^2, over which it is the mean. NODE_THROWN: without what photons bring.
vec3 lobe_radiance(uint index, vec3 towards, float blur)
{
  ivec2 texel = ivec2(int(index & 2047u), int(index >> 11u));
  vec3 flux = node_flux_fetch(texel).rgb;
  float light = luminance(flux);
  if (light <= DARK) {
    return vec3(0.0);
  }
  vec3 way = node_ways_fetch(texel).xyz / light;
  float mean = clamp(length(way), 1e-3, 0.99999);
  float sharpness = mean * (3.0 - mean * mean) / (1.0 - mean * mean);  // Banerjee et al. 2005
  sharpness /= 1.0 + sharpness * blur;
  float peak = sharpness / (2.0 * PI * (1.0 - exp(-2.0 * sharpness)));
#ifdef NODE_THROWN
  flux = max(flux - node_thrown_fetch(texel).rgb, vec3(0.0));
#endif
  return flux * peak * exp(sharpness * (dot(way, towards) / mean - 1.0));
}
