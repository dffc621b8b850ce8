// Filtered light times the surface's colour, as a sum over the samples; what was not filtered as it was summed up.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 light = texelFetch(light_in, pixel, 0);
  vec4 color = texelFetch(color_sum, pixel, 0);
  vec4 sum = texelFetch(sum_now, pixel, 0);
  out_sum = (light.a < 0.0) ? sum : vec4(light.rgb * max(color.rgb, vec3(LEAST_COLOR * float(count))), sum.a);
}
