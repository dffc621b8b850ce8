// Records of silhouette edges (lighting/edge_tiles.py), four texels each: both ends, and the planes of both triangles.
vec4 edge_texel(int index)
{
  return edge_records_fetch(ivec2(index & 2047, index >> 11));
}

// What the edge from v0 to v1 adds to layers beside it, as seen from p: the facings of its triangles, of opposite signs. As
// seen from the light's centre with STANDARD.
int edge_weight(int record, vec4 v0, vec4 v1, vec3 p)
{
#ifdef STANDARD
  return -int(v1.w);
#else
  int code = int(v0.w);
  int one = code - 3 * (code / 3) - 1;
  int two = code / 3 - 1;
  return ((plane_side(edge_texel(record + 2), p) >= 0.0) ? one : -one)
         + ((plane_side(edge_texel(record + 3), p) >= 0.0) ? two : -two);
#endif
}
