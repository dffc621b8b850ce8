// Filtered light times the surface's colour, as a sum over the samples; what was not filtered as it was summed up.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 light = light_in_fetch(pixel);
  vec4 sum = sum_now_fetch(pixel);
#ifdef OF_MEDIA
  out_sum = vec4((light.a < 0.0) ? sum.rgb : light.rgb * float(count), sum.a);
#else
  vec4 color = color_sum_fetch(pixel);
  vec3 filtered = light.rgb * max(color.rgb, vec3(LEAST_COLOR * float(count)));
#ifdef APART
  filtered += apart_sum_fetch(pixel).rgb;
#endif
  out_sum = (light.a < 0.0) ? sum : vec4(filtered, sum.a);
#endif
}
