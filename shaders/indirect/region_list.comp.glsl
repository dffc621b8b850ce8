// The regions of one level that gather, each an entry of a list in no order; with level 1 the pixels of split regions, too.
#include "indirect/regions.glsl"

void add(int index, ivec2 region, int level_of_region)
{
  uint entry = uint(region.x) | (uint(region.y) << REGION_BITS) | (uint(level_of_region) << (2 * REGION_BITS));
  imageStore(entries, entry_place(index), uvec4(entry));
}

void main()
{
  ivec2 region = ivec2(gl_GlobalInvocationID.xy);
  if (any(greaterThanEqual(region, region_flags_size()))) {
    return;
  }
  vec2 flags = region_flags_fetch(region).xy;
  if (flags.x < 0.5) {
    bool largest = level == levels || coarser_flags_fetch(region >> 1).x > 0.5;
    if (largest && flags.y == 1.0) {
      add(int(imageAtomicAdd(entry_count, ivec2(0), 1u)), region, level);
    }
    return;
  }
  if (level > 1) {
    return;
  }
  ivec2 pixels[4];
  int found = 0;
  for (int child = 0; child < 4; child++) {
    ivec2 place = 2 * region + ivec2(child & 1, child >> 1);
    ivec2 pixel = place - grid_offset;
    bool outside = any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, surface_position_size()));
    if (!outside && surface_position_fetch(pixel).w != 0.0) {
      pixels[found++] = place;
    }
  }
  if (found > 0) {
    int first = int(imageAtomicAdd(entry_count, ivec2(0), uint(found)));
    for (int i = 0; i < found; i++) {
      add(first + i, pixels[i], 0);
    }
  }
}
