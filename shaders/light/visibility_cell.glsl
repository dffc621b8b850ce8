// Which pixels lie on the plane of a cell whose corners know the visibility of lights (light/visibility_cells.frag.glsl).
#include "lib/gbuffer.glsl"
#include "neighbours/pixel_size.glsl"

// Whether a surface is seen in a pixel that has to look for itself.
bool stands_apart(ivec2 pixel)
{
  vec4 position = surface_position_fetch(pixel);
  vec4 plane = cell_plane_fetch(pixel / RATE);
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  float off = abs(dot(position.xyz, plane.xyz) - plane.w);
  bool within = dot(plane.xyz, normal) > FACING && off < OFF_PLANE * pixel_size_at(position.xyz);
  return position.w != 0.0 && !within;
}
