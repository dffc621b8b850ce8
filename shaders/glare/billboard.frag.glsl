// The kernel about a place between pixels, times the light that scatters there; to be added up.
vec3 weight_at(ivec2 texel)
{
  bool inside = all(greaterThanEqual(texel, ivec2(0))) && all(lessThan(texel, weights_size()));
  return inside ? weights_fetch(texel).rgb : vec3(0.0);
}

void main()
{
  vec2 place = gl_FragCoord.xy - middle + float(reach);
  ivec2 first = ivec2(floor(place));
  vec2 share = place - floor(place);
  vec3 low = mix(weight_at(first), weight_at(first + ivec2(1, 0)), share.x);
  vec3 high = mix(weight_at(first + ivec2(0, 1)), weight_at(first + ivec2(1, 1)), share.x);
  out_light = vec4(light.rgb * mix(low, high, share.y), 1.0);
}
