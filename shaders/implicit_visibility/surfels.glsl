// Surfels, their tree and their receivers as lists (addon/scene/surfels.py). Receiver i is a side of a surfel; its light
// stands at column i & 255, row i >> 8 of images of receivers.
#define SURFEL_TEXELS 5
#define RECEIVER_TEXELS 2
#define RECEIVER_ROW 8  // bits of a column

#ifdef SURFEL_TREE
vec4 surfel_node(int node, int texel)
{
  int i = node * SURFEL_TEXELS + texel;
  return surfel_nodes_fetch(ivec2(i & 2047, i >> 11));
}
#endif

ivec2 receiver_pixel(int receiver)
{
  return ivec2(receiver & ((1 << RECEIVER_ROW) - 1), receiver >> RECEIVER_ROW);
}

// A link in one number that is exact in a float: 0 is none.
float link_of(int node, bool front)
{
  return float(2 * node + (front ? 1 : 2));
}
