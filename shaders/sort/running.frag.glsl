// Sums of all that stands before each entry of a list. They never fall where no entry is negative, rounding included.
void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy);
  int columns_of_runs = LIST_COLUMNS / LIST_RUN;
  int own = place.y * columns_of_runs + place.x / LIST_RUN;
  vec2 before = vec2(0.0);
  for (int k = 0; k < own; k++) {
    before += run_sums_fetch(ivec2(k % columns_of_runs, k / columns_of_runs)).xy;
  }
  vec2 within = vec2(0.0);
  for (int x = place.x / LIST_RUN * LIST_RUN; x < place.x; x++) {
    within += listed_fetch(ivec2(x, place.y)).xy;
  }
  out_before = before + within;
}
