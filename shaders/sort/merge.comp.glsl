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
    int low = 0;
    int high = LIST_COLUMNS;
    while (low < high) {
      int middle = (low + high) / 2;
      uint other = row_keys_fetch(ivec2(middle, y)).x;
      bool earlier = other < key || (other == key && y < place.y);
      low = earlier ? middle + 1 : low;
      high = earlier ? high : middle;
    }
    before += low;
  }
  ivec2 target_place = ivec2(before % LIST_COLUMNS, before / LIST_COLUMNS);
  imageStore(sorted_keys, target_place, uvec4(key));
  imageStore(sorted_order, target_place, uvec4(row_order_fetch(place).x));
}
