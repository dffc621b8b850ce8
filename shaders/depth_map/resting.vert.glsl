// Casters in world space: addon/scene/casters.py has left out what is hidden or lets light pass.
#include "lib/projection.glsl"

void main()
{
  vec4 p = vec4(position, 1.0);
  // As in opaque.vert.glsl: q and w are carried apart so that clipped triangles stay planar.
  depth_terms = vec2(dot(row_q, p), dot(row_w, p));
  gl_Position = project(position, PROJECTION);
}
