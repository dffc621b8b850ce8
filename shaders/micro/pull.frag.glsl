// Mean radiance of nodes from that of nodes up to PULLED levels below, weighted by area. FIRST: of the points.
// Entry 2 k + side of the list belongs to node k of the heap; node 1 is the root.
vec4 known_entry(int node, int side)
{
#ifdef FIRST
  int entry = 2 * (node - leaf_count) + side;
  return sent_fetch(ivec2(entry % POINT_ROW, entry / POINT_ROW));
#else
  int entry = 2 * node + side;
  return sent_fetch(ivec2(entry & 2047, entry >> 11));
#endif
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int entry = (pixel.y << 11) + pixel.x;
  int node = entry >> 1;
  out_radiance = vec4(0.0);
  if (node == 0 || node >= 2 * leaf_count) {
    return;
  }
  int level = 0;
  for (int k = node; k > 1; k >>= 1) {
    level++;
  }
  if (level >= known_level) {
    out_radiance = known_entry(node, entry & 1);
  }
  else if (level >= known_level - PULLED) {
    int count = 1 << (known_level - level);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < count; i++) {
      vec4 below = known_entry(node * count + i, entry & 1);
      sum += vec4(below.rgb * below.w, below.w);
    }
    out_radiance = vec4(sum.rgb / max(sum.w, 1e-30), sum.w);
  }
}
