// The pattern as the picture's pixels see it: box averages of bilinear lookups, `steps` x `steps` to a pixel.
vec3 between(vec2 place)
{
  ivec2 first = ivec2(floor(place));
  vec2 share = place - floor(place);
  ivec2 last = pattern_size() - 1;
  if (any(lessThan(first, ivec2(0))) || any(greaterThanEqual(first, last))) {
    return vec3(0.0);
  }
  vec3 low = mix(pattern_fetch(first).rgb, pattern_fetch(first + ivec2(1, 0)).rgb, share.x);
  vec3 high = mix(pattern_fetch(first + ivec2(0, 1)).rgb, pattern_fetch(first + ivec2(1, 1)).rgb, share.x);
  return mix(low, high, share.y);
}

void main()
{
  vec2 offset = vec2(ivec2(gl_FragCoord.xy) - ivec2(reach));
  float middle = float(pattern_size().x / 2);
  vec3 sum = vec3(0.0);
  for (int j = 0; j < steps; j++) {
    for (int i = 0; i < steps; i++) {
      vec2 inside = (vec2(float(i), float(j)) + 0.5) / float(steps) - 0.5;
      sum += between((offset + inside) * texels_per_pixel + middle);
    }
  }
  out_weight = vec4(sum / float(steps * steps), 0.0);
}
