// Which of 32 edges can hide a part of the light from the receivers of a tile: bit k of a word for edge 32 word + k.
// A tile is outside of an edge's wedge if its box lies beyond one of the wedge's four planes.
#include "edges/light.glsl"

vec4 wedge_texel(int index)
{
  return edge_wedges_fetch(ivec2(index & 2047, index >> 11));
}

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  ivec2 tiles = low_of_tiles_size();
  int index = place.x + 2048 * place.y;
  int tile = index / edge_light.word_count;
  if (place.x >= 2048 || tile >= tiles.x * tiles.y) {
    return;
  }
  ivec2 where = ivec2(tile % tiles.x, tile / tiles.x);
  vec3 low = low_of_tiles_fetch(where).xyz;
  vec3 high = high_of_tiles_fetch(where).xyz;
  uint word = 0u;
  if (low.x <= high.x) {
    vec3 middle = 0.5 * (low + high);
    vec3 extent = 0.5 * (high - low);
    float slack = 4e-6 * max(max(abs(middle.x), abs(middle.y)), abs(middle.z));
    int first = (index % edge_light.word_count) * 32;
    int last = min(first + 32, edge_light.edge_count);
    for (int edge = first; edge < last; edge++) {
      float beyond = -1e30;
      for (int k = 0; k < 4; k++) {
        vec4 plane = wedge_texel(4 * edge + k);
        beyond = max(beyond, dot(plane.xyz, middle) + plane.w - dot(abs(plane.xyz), extent) - slack);
      }
      word |= (beyond > 0.0) ? 0u : (1u << uint(edge - first));
    }
  }
  imageStore(tile_words, place, uvec4(word, 0u, 0u, 0u));
}
