// An image at a place of another one.
void main()
{
  out_copy = vec4(original_fetch(ivec2(gl_FragCoord.xy) - place));
}
