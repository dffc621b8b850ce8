// What clusters see: per direction the distance of the nearest surface, as share of the map's range, and its normal in the
// cluster's frame.
#include "indirect/path.glsl"
#include "cluster/lights.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  ivec2 tile = texel / map_side;
  int index = tile.x + tile.y * map_columns;
  out_seen = vec4(1.0, 0.0, 0.0, 0.0);
  if (index >= cluster_count) {
    return;
  }
  Cluster c = cluster_read(index);
  vec3 local = map_direction((vec2(texel - tile * map_side) + 0.5) / float(map_side));
  vec3 direction = local.x * c.across + local.y * c.along + local.z * c.normal;
  // Below its own surface the middle sees nothing, other members may: no information counts as lit.
  if (dot(direction, c.plane_normal) <= 0.01) {
    return;
  }
  ivec2 hit;
  uvec3 roll = hash3(uvec3(uvec2(texel), uint(film_view.sample_index)));
  float t = trace_nearest(ray_origin(c.middle, c.plane_normal), direction, c.range, roll.x, hit);
  if (t >= c.range) {
    return;
  }
  out_seen = vec4(t / c.range, octahedral_encode(cluster_local(c, triangle_normal(hit))), 1.0);
}
