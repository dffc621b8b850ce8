// Sums of runs of a list.
void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy);
  vec2 sum = vec2(0.0);
  for (int x = 0; x < LIST_RUN; x++) {
    sum += listed_fetch(ivec2(place.x * LIST_RUN + x, place.y)).xy;
  }
  out_sum = sum;
}
