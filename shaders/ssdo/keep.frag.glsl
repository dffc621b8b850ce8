// The sums so far, for the sample after this one.
void main()
{
  out_sum = texelFetch(sum_now, ivec2(gl_FragCoord.xy), 0);
}
