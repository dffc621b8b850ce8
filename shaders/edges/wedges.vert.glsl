// A corner of an edge's prism (addon/lighting/edge_raster.py).
#include "edges/project.glsl"

void main()
{
  int index = 24 * gl_InstanceID + number;
  vec4 corner = wedge_corners_fetch(ivec2(index & 2047, index >> 11));
  flat_edge = float(gl_InstanceID);
  gl_Position = (corner.w > 1.5) ? vec4(corner.xy, 0.0, 1.0) : project_flat(corner.xyz, 1.0);
}
