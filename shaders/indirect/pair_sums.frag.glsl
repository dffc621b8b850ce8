// How densely all candidates of a group together fall on the next surface of each of them.
void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy);
  int index = place.y * LIST_COLUMNS + place.x;
  float sum = 0.0;
  for (int k = 0; k < GROUP; k++) {
    sum += pairs_fetch(ivec2(index % GROUP, index / GROUP * GROUP + k)).x;
  }
  out_sum = sum;
}
