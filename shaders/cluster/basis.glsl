// What is filtered of the maps of clusters: the basis functions of a texel's depth, tile by tile (lib/convolution.glsl).
#include "lib/convolution.glsl"
#include "cluster/depth.glsl"

vec4 basis_source(ivec2 place)
{
  ivec2 tile = place / base_extent;
  int index = tile.x + tile.y * tile_columns;
  if (index >= BASIS_TILES) {
    return vec4(0.0);
  }
  return basis_values(index, cluster_depth(cluster_maps_fetch(place - tile * base_extent).x));
}
