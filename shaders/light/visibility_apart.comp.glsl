// Visibility of lights at the pixels that look for themselves (light/visibility_between.comp.glsl): those in a list for
// each light, or, where shaders cannot count, all that are marked. Of the lights one above the other.
// Leaves out media: visibility alone is found; the pass of light that reads it asks them.
// Leaves out links: likewise.
#include "light/visibility_at.glsl"
#ifdef LISTED
#include "lib/entry_list.glsl"
#endif

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
  ivec2 size = surface_position_size();
#ifdef LISTED
  // All lists' runs one after the other, so that threads are idle at the end of the last alone.
  ivec4 counts = ivec4(0);
  ivec4 ends = ivec4(0);
  int end = 0;
  for (int i = 0; i < light_count; i++) {
    counts[i] = int(entry_count_fetch(ivec2(i, 0)).x);
    end += (counts[i] + RUN - 1) / RUN;
    ends[i] = end;
  }
  // Where branches are masked, a loop ends all the same: threads beyond the lists take one turn.
  for (int run = (place.x / RUN) * size.y + place.y; run < end; run += (columns / RUN) * size.y) {
    int list = 0;
    int first = 0;
    for (int i = 0; i < light_count - 1; i++) {
      list = (run >= ends[i]) ? i + 1 : list;
      first = (run >= ends[i]) ? ends[i] : first;
    }
    int index = (run - first) * RUN + place.x % RUN;
    if (index < counts[list]) {
      ivec2 above = ivec2(0, list * size.y);
      uint entry = entries_fetch(entry_place(index) + above).x;
      ivec2 pixel = ivec2(int(entry & 0xFFFFu), int(entry >> 16));
      imageStore(pixel_visibility, pixel + above, vec4(visibility_at(pixel, list)));
    }
  }
#else
  for (int i = 0; i < light_count && all(lessThan(place, size)); i++) {
    ivec2 above = ivec2(0, i * size.y);
    if (imageLoad(pixel_visibility, place + above).x < 0.0) {
      imageStore(pixel_visibility, place + above, vec4(visibility_at(place, i)));
    }
  }
#endif
}
