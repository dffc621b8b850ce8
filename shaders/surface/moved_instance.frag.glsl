// What the list of instances holds of one of them, drawn into its place.
void main()
{
  out_texel = moved.texel[int(gl_FragCoord.x) - first];
}
