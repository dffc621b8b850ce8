// The pattern of 575 nm as it is in white light: sum over wavelengths of its copies, larger for red, with their colours.
// Source: Ritschel et al. 2009 with a fixed number; here it grows with the radius, so that copies leave no gaps.
float between(vec2 place)
{
  ivec2 first = ivec2(floor(place));
  vec2 share = place - floor(place);
  ivec2 last = pattern_size() - 1;
  if (any(lessThan(first, ivec2(0))) || any(greaterThanEqual(first, last))) {
    return 0.0;
  }
  float low = mix(pattern_fetch(first).x, pattern_fetch(first + ivec2(1, 0)).x, share.x);
  float high = mix(pattern_fetch(first + ivec2(0, 1)).x, pattern_fetch(first + ivec2(1, 1)).x, share.x);
  return mix(low, high, share.y);
}

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  int middle = pattern_size().x / 2;
  vec2 offset = vec2(texel - ivec2(middle));
  float radius = length(offset);
  vec3 sum = vec3(0.0);
  if (radius < usable) {
    int count = clamp(int(ceil(steps_per_texel * radius)), least, most);
    for (int k = 0; k < count; k++) {
      int entry = int((float(k) + 0.5) / float(count) * float(spectrum_size().x));
      vec4 row = spectrum_fetch(ivec2(entry, 0));
      sum += row.rgb * between(offset * row.a + float(middle));
    }
    float fade = clamp((usable - radius) / ((1.0 - fade_from) * usable), 0.0, 1.0);
    sum *= fade * fade * (3.0 - 2.0 * fade) / float(count);
  }
  // Single wavelengths lie outside of the picture's colours; only their sum may be cut.
  out_colour = vec4(max(sum, vec3(0.0)), 0.0);
}
