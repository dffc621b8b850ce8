// An image as it stands.
void main()
{
  out_copy = original_fetch(ivec2(gl_FragCoord.xy));
}
