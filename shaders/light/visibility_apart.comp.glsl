// Visibility of up to four lights at the pixels that look for themselves: those of a list, or, where shaders cannot count,
// all that are found to.
#include "light/visibility_at.glsl"
#ifdef LISTED
#include "lib/entry_list.glsl"
#else
#include "light/visibility_cell.glsl"
#endif

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
#ifdef LISTED
  // Where branches are masked, a loop ends all the same: threads beyond the list take one turn.
  int count = int(entry_count_fetch(ivec2(0)).x);
  for (; entry_index(place) < count; place.x += columns) {
    uint entry = entries_fetch(place).x;
    ivec2 pixel = ivec2(int(entry & 0xFFFFu), int(entry >> 16));
    imageStore(own_visibility, pixel, visibility_at(pixel));
  }
#else
  if (all(lessThan(place, surface_position_size())) && stands_apart(place)) {
    imageStore(own_visibility, place, visibility_at(place));
  }
#endif
}
