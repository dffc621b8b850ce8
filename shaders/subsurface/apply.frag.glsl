// Puts the light that left surfaces in the place of the light that entered them, where anything scatters.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (scatter_share_fetch(pixel).w < 4.0) {
    discard;
  }
  out_direct = left_direct_fetch(pixel);
  out_indirect = left_indirect_fetch(pixel);
}
