// Triangles as casters are drawn into a depth map (addon/frame/device_probe.py).
#include "lib/projection.glsl"

void main()
{
  depth_terms = vec2(dot(row_q, vec4(position, 1.0)), dot(row_w, vec4(position, 1.0)));
  gl_Position = project(position, row_x, row_y, row_w, row_q, near);
}
