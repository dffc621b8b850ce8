// Which pixels a cell between looked-up ones (light/visibility_cells.frag.glsl) leaves to look for themselves.
#include "lib/gbuffer.glsl"
#include "light/cell_corners.glsl"
#include "neighbours/pixel_size.glsl"

// Whether a surface is seen in a pixel that does not lie on the cell's plane, or the cell does not know the light there.
bool looks_itself(ivec2 pixel, int index)
{
  vec4 position = surface_position_fetch(pixel);
  vec4 plane = cell_plane_fetch(pixel / RATE);
  vec4 corners = cell_corners(pixel / RATE, index);
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  float off = abs(dot(position.xyz, plane.xyz) - plane.w);
  bool on_plane = dot(plane.xyz, normal) > FACING && off < OFF_PLANE * pixel_size_at(position.xyz);
  bool known = max(max(corners.x, corners.y), max(corners.z, corners.w)) >= 0.0;
  return position.w != 0.0 && !(on_plane && known);
}
