// What convolution shadow maps filter: the basis functions of the depth in a texel, tile by tile (lib/convolution.glsl).
#include "lib/convolution.glsl"
#include "cssm/range.glsl"

vec4 basis_source(ivec2 place)
{
  ivec2 tile = place / base_extent;
  ivec2 texel = place - tile * base_extent;
  int index = tile.x + tile.y * tile_columns;
  if (index >= BASIS_TILES) {
    return vec4(0.0);
  }
  vec4 caster = depth_maps_fetch(texel);
  bool perspective;
  vec2 range = cssm_range(texel, perspective);
  // Where nothing was drawn nothing blocks: as far as can be.
  float z = (caster.w > 0.0) ? basis_depth(caster.x, range, perspective) : 0.95;
  return basis_values(index, z);
}
