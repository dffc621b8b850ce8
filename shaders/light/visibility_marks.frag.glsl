// Marks by the depth which pixels look for the visibility of lights themselves (1), and which lie on the plane of a cell
// whose corners know it (0); 0.5 where nothing is seen.
#include "lib/gbuffer.glsl"
#include "neighbours/pixel_size.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 position = surface_position_fetch(pixel);
  vec4 plane = cell_plane_fetch(pixel / RATE);
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  float off = abs(dot(position.xyz, plane.xyz) - plane.w);
  bool within = dot(plane.xyz, normal) > FACING && off < OFF_PLANE * pixel_size_at(position.xyz);
  gl_FragDepth = (position.w == 0.0) ? 0.5 : (within ? 0.0 : 1.0);
}
