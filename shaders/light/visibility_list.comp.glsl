// The list of the pixels and lights whose visibility has to be looked up (addon/frame/lists.py).
#include "light/visibility_cell.glsl"
#include "lib/entry_list.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(pixel, surface_position_size()))) {
    return;
  }
  vec4 position = surface_position_fetch(pixel);
  bool on_plane = lies_on_plane(pixel, position.xyz);
  uvec4 sought;
  int count = 0;
  for (int i = 0; i < light_count; i++) {
    if (!on_plane || !cell_knows(pixel / RATE, i)) {
      sought[count++] = uint(i);
    }
  }
  if (count > 0 && position.w != 0.0) {
    int index = int(imageAtomicAdd(entry_count, ivec2(0), uint(count)));
    for (int k = 0; k < count; k++) {
      uint entry = uint(pixel.x) | (uint(pixel.y) << PIXEL_BITS) | (sought[k] << (2 * PIXEL_BITS));
      imageStore(entries, entry_place(index + k), uvec4(entry));
    }
  }
}
