// Maps with their holes filled from those of half the side. A texel that looks through a gap between nearer points, onto
// something farther, is a hole too.
#include "ism/paraboloid.glsl"

void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy);
  ivec2 tile = place / map_side;
  TexelRay ray = texel_ray(place - tile * map_side, map_side, half_extent);
  out_plane = finer_maps_fetch(place).xy;
  vec2 coarse = coarser_maps_fetch(place >> 1).xy;
  Plane seen = plane_unpack(out_plane);
  float own = plane_along(seen, ray, half_extent);
  float filled = plane_along(plane_unpack(coarse), ray, half_extent);
  // In maps of directions: discs of a curved surface differ by about a texel, triangles that are whole are another surface.
  float far = threshold * ((half_extent > 0.0) ? half_extent * (seen.whole ? 0.1 : 1.0) : filled);
  if (filled < 1e30 && own > filled + far) {
    out_plane = coarse;
  }
}
