// What a cell between looked-up pixels (light/visibility_cells.frag.glsl) leaves a pixel to look up.
#include "lib/gbuffer.glsl"
#include "light/cell_corners.glsl"
#include "neighbours/pixel_size.glsl"

// Whether the surface that is seen in a pixel lies on the cell's plane.
bool lies_on_plane(ivec2 pixel, vec3 position)
{
  vec4 plane = cell_plane_fetch(pixel / RATE);
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  float off = abs(dot(position, plane.xyz) - plane.w);
  return dot(plane.xyz, normal) > FACING && off < OFF_PLANE * pixel_size_at(position);
}

bool cell_knows(ivec2 cell, int index)
{
  vec4 corners = cell_corners(cell, index);
  return max(max(corners.x, corners.y), max(corners.z, corners.w)) >= 0.0;
}
