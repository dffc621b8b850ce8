// Mean radiance that both sides of each node's leaves send, by area. Nodes that no link leads to are left out.
// Pixel: side of a node 2 node + side (0 front, 1 back), 2048 in a row.
#include "implicit_visibility/surfels.glsl"

void main()
{
  out_radiance = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int entry = pixel.x + (pixel.y << 11);
  int node = entry >> 1;
  if (node >= node_count || surfel_node(node, 1).z <= 0.0) {
    return;
  }
  vec4 leaves = surfel_node(node, 2);
  int first = int(leaves.x);
  vec3 sum = vec3(0.0);
  float area = 0.0;
  for (int leaf = first; leaf < first + int(leaves.y); leaf++) {
    vec4 own = surfel_leaves_fetch(ivec2(leaf & 2047, leaf >> 11));
    int receiver = int(((entry & 1) == 0) ? own.y : own.z);
    if (receiver >= 0) {
      sum += own.x * sent_fetch(receiver_pixel(receiver)).rgb;
    }
    area += own.x;
  }
  out_radiance.rgb = sum / max(area, 1e-30);
}
