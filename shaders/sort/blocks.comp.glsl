// A row of a list in the order of its keys; equal keys keep their order.
void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  if (place.y >= unsorted_size().y) {
    return;
  }
  uint key = unsorted_fetch(place).x;
  int before = 0;
  for (int x = 0; x < LIST_COLUMNS; x++) {
    uint other = unsorted_fetch(ivec2(x, place.y)).x;
    before += (other < key || (other == key && x < place.x)) ? 1 : 0;
  }
  imageStore(row_keys, ivec2(before, place.y), uvec4(key));
  imageStore(row_order, ivec2(before, place.y), uvec4(uint(place.y * LIST_COLUMNS + place.x)));
}
