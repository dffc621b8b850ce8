// The list of media, and above it, from `first_row` on, the extinction of what varies.
void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy);
  if (place.y < first_row) {
    out_texel = media_list_fetch(place);
  }
  else {
    out_texel = extinction_fetch(place - ivec2(0, first_row));
  }
}
