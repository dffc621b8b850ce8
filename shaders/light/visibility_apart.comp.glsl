// Visibility of a light at the pixels that look for themselves: those of a list, or, where shaders cannot count, all that
// are found to. Of the lights one above the other.
#include "light/visibility_at.glsl"
#ifdef LISTED
#include "lib/entry_list.glsl"
#else
#include "light/looks_itself.glsl"
#endif

void look(ivec2 pixel)
{
  ivec2 place = pixel + ivec2(0, light_index * surface_position_size().y);
  imageStore(own_visibility, place, vec4(visibility_at(pixel, light_index)));
}

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
#ifdef LISTED
  // Where branches are masked, a loop ends all the same: threads beyond the list take one turn.
  int count = int(entry_count_fetch(ivec2(0)).x);
  for (; entry_index(place) < count; place.x += columns) {
    uint entry = entries_fetch(place).x;
    look(ivec2(int(entry & 0xFFFFu), int(entry >> 16)));
  }
#else
  if (all(lessThan(place, surface_position_size())) && looks_itself(place, light_index)) {
    look(place);
  }
#endif
}
