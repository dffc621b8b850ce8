// The candidates that were kept, side by side: place in the list, number, weight; w: 1, or 0 where there are no more.
void main()
{
  out_slot = vec4(0.0);
  float slot = floor(gl_FragCoord.x);
  int low = 0;
  int high = candidate_count;  // the last entry with no more than `slot` before it has the candidate
  while (low < high) {
    int middle = (low + high) / 2;
    ivec2 next = ivec2((middle + 1) % LIST_COLUMNS, (middle + 1) / LIST_COLUMNS);
    bool passed = kept_before_fetch(next).x <= slot;
    low = passed ? middle + 1 : low;
    high = passed ? high : middle;
  }
  if (low >= candidate_count) {
    return;
  }
  ivec2 place = ivec2(low % LIST_COLUMNS, low / LIST_COLUMNS);
  out_slot = vec4(float(low), float(sorted_order_fetch(place).x), kept_list_fetch(place).y, 1.0);
}
