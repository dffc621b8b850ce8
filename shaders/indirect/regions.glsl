// Regions of pixels and where what is gathered for them lies: the programs of addon/techniques/multires_radiosity.py.
// An entry of the list of regions has REGION_BITS for each axis.
#include "lib/math.glsl"
#include "lib/entry_list.glsl"

// The pixel that stands for a region.
ivec2 region_pixel(ivec2 region, int level_of_region)
{
  ivec2 pixel = (region << level_of_region) + ((1 << level_of_region) >> 1) - grid_offset;
  return clamp(pixel, ivec2(0), surface_position_size() - 1);
}

// Where a region lies in the atlas: pixels, and right of them, one above the other, the regions of levels 1, 2, …
ivec2 region_place(ivec2 region, int level_of_region)
{
  if (level_of_region == 0) {
    return region;
  }
  int below = atlas_size.y - (atlas_size.y >> (level_of_region - 1));  // 1/2 + 1/4 + …
  return region + ivec2(atlas_size.x, below);
}
