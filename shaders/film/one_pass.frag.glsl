// One render pass as the viewport shows it: a mean over samples, of light over the surface's colour where `divided`, as
// Cycles writes its passes; a single channel as grey, or three.

#define LEAST_COLOR 1e-6  // light is not divided by less

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 value = source_fetch(pixel) * scale;
  vec3 shown = channel < 0 ? value.rgb : vec3(value[channel]);
  if (divided == 1) {
    vec3 own = albedo_fetch(pixel).rgb * albedo_scale;
    vec3 quotient = vec3(0.0);
    float count = 0.0;
    for (int k = 0; k < 3; k++) {
      if (abs(own[k]) > LEAST_COLOR) {
        quotient[k] = shown[k] / own[k];
        count += 1.0;
      }
    }
    float mean = (quotient.r + quotient.g + quotient.b) / max(count, 1.0);
    for (int k = 0; k < 3; k++) {
      if (!(abs(own[k]) > LEAST_COLOR)) {
        quotient[k] = mean;
      }
    }
    shown = quotient;
  }
  out_color = vec4(shown, 1.0);
}
