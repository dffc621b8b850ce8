// Visibility of lights at the pixels that cells do not tell it: those of a list, or, where shaders cannot count, all that
// are found. Of the lights one above the other.
#include "light/visibility_at.glsl"
#ifdef LISTED
#include "lib/entry_list.glsl"
#else
#include "light/visibility_cell.glsl"
#endif

void look(ivec2 pixel, int index)
{
  imageStore(own_visibility, pixel + ivec2(0, index * surface_position_size().y), vec4(visibility_at(pixel, index)));
}

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
#ifdef LISTED
  // Where branches are masked, a loop ends all the same: threads beyond the list take one turn.
  int count = int(entry_count_fetch(ivec2(0)).x);
  int most = (1 << PIXEL_BITS) - 1;
  for (; entry_index(place) < count; place.x += columns) {
    int entry = int(entries_fetch(place).x);
    look(ivec2(entry & most, (entry >> PIXEL_BITS) & most), (entry >> (2 * PIXEL_BITS)) & 3);
  }
#else
  if (any(greaterThanEqual(place, surface_position_size())) || surface_position_fetch(place).w == 0.0) {
    return;
  }
  bool on_plane = lies_on_plane(place, surface_position_fetch(place).xyz);
  for (int i = 0; i < light_count; i++) {
    if (!on_plane || !cell_knows(place / RATE, i)) {
      look(place, i);
    }
  }
#endif
}
