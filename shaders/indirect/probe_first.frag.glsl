// 1 where a cell begins in the sorted list.
void main()
{
  out_first = vec2(0.0);
  ivec2 place = ivec2(gl_FragCoord.xy);
  int index = place.y * LIST_COLUMNS + place.x;
  uint key = sorted_keys_fetch(place).x;
  if (index >= lattice.x * lattice.y || key == 0xFFFFFFFFu) {
    return;
  }
  int last = max(index - 1, 0);
  bool first = index == 0 || sorted_keys_fetch(ivec2(last % LIST_COLUMNS, last / LIST_COLUMNS)).x != key;
  out_first = vec2(first ? 1.0 : 0.0, 0.0);
}
