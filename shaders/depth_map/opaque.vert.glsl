// Casters without alpha: positions only.
#include "lib/instance.glsl"
#include "lib/projection.glsl"

void main()
{
  int id = first_instance + local_instance + gl_InstanceID;
  Instance instance = instance_read(id);
  vec3 p = instance_position(instance, position);
  // Window coordinates are linear in clip x / w; q and w are carried apart so that clipped triangles stay planar.
  depth_terms = vec2(dot(row_q, vec4(p, 1.0)), dot(row_w, vec4(p, 1.0)));
  gl_Position = instance_seen(instance) ? project(p, PROJECTION) : vec4(2.0, 2.0, 2.0, 1.0);
}
