// Maps with their holes filled from those of half the side. A texel that looks through a gap between nearer points, onto
// something farther, is a hole too.
#include "ism/paraboloid.glsl"

void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy);
  ivec2 tile = place / map_side;
  vec3 direction = texel_direction(place - tile * map_side, map_side);
  out_plane = finer_maps_fetch(place).xy;
  vec2 coarse = coarser_maps_fetch(place >> 1).xy;
  float own = plane_along(plane_unpack(out_plane), direction);
  float filled = plane_along(plane_unpack(coarse), direction);
  if (filled < 1e30 && own > filled * (1.0 + threshold)) {
    out_plane = coarse;
  }
}
