// An image as it stands.
void main()
{
  out_copy = texelFetch(original, ivec2(gl_FragCoord.xy), 0);
}
