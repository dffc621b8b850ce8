// The whole list from rows that are in order: an entry stands behind all of other rows that come before it.
void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  int rows = row_keys_size().y;
  if (place.y >= rows) {
    return;
  }
  uint key = row_keys_fetch(place).x;
  int before = place.x;
  for (int y = 0; y < rows; y++) {
    if (y == place.y) {
      continue;
    }
    // Bisection in as many steps for all, LIST_COLUMNS a power of two: no lane waits for another one.
    bool first = y < place.y;
    int low = 0;
    for (int half_width = LIST_COLUMNS / 2; half_width > 0; half_width /= 2) {
      uint other = row_keys_fetch(ivec2(low + half_width - 1, y)).x;
      low += (other < key || (first && other == key)) ? half_width : 0;
    }
    uint last = row_keys_fetch(ivec2(low, y)).x;  // low < LIST_COLUMNS, since the steps sum up to one less
    low += (last < key || (first && last == key)) ? 1 : 0;
    before += low;
  }
  ivec2 target_place = ivec2(before % LIST_COLUMNS, before / LIST_COLUMNS);
  imageStore(sorted_keys, target_place, uvec4(key));
  imageStore(sorted_order, target_place, uvec4(row_order_fetch(place).x));
}
