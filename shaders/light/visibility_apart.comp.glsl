// Visibility of lights at the pixels that look for themselves (light/visibility_between.comp.glsl): those of a list for
// each light, or, where shaders cannot count, of all 2^finer_bits apart those that are marked. Of the lights one above the
// other.
#include "light/visibility_at.glsl"
#ifdef LISTED
#include "lib/entry_list.glsl"
#else
#include "light/cell.glsl"
#endif

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
  ivec2 size = surface_position_size();
#ifdef LISTED
  // All lists' runs one after the other.
  ivec4 ends = ivec4(0);
  ivec4 counts = ivec4(0);
  int end = 0;
  for (int i = 0; i < 4; i++) {
    counts[i] = (i < light_count) ? int(entry_count_fetch(ivec2(i, 0)).x) : 0;
    end += (counts[i] + RUN - 1) / RUN;
    ends[i] = end;
  }
  int lane = place.x % RUN;
  // Where branches are masked, a loop ends all the same: threads beyond the list take one turn.
  for (int run = (place.x / RUN) * list_rows + place.y; run < end; run += (columns / RUN) * list_rows) {
    int light_index = int(dot(vec4(greaterThanEqual(ivec4(run), ends)), vec4(1.0)));
    int index = (run - ((light_index > 0) ? ends[light_index - 1] : 0)) * RUN + lane;
    if (index < counts[light_index]) {
      uint entry = entries_fetch(entry_place(index, list_rows) + ivec2(0, light_index * list_rows)).x;
      ivec2 pixel = ivec2(int(entry & 0xFFFFu), int(entry >> 16));
      imageStore(pixel_visibility, pixel + ivec2(0, light_index * size.y), vec4(visibility_at(pixel, light_index)));
    }
  }
#else
  ivec2 pixel = min(place << finer_bits, size - 1);
  for (int i = 0; i < light_count; i++) {
    ivec2 there = pixel + ivec2(0, i * size.y);
    if (all(lessThanEqual(place, last_place(finer_bits))) && imageLoad(pixel_visibility, there).x < 0.0) {
      imageStore(pixel_visibility, there, vec4(visibility_at(pixel, i)));
    }
  }
#endif
}
