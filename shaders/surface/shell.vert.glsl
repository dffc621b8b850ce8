// Vertex of the shell over a mesh in which the relief of its material lies (addon/scene/shells.py).
#include "lib/instance.glsl"
#include "lib/projection.glsl"

void main()
{
  int id = first_instance + local_instance + gl_InstanceID;
  Instance instance = instance_read(id);
  vec4 levels = shell_corners_fetch(ivec2(0, 0));
  world_normal = normalize(instance_normal(instance, normal));
  world_position = instance_position(instance, position) + world_normal * mix(levels.x, levels.y, shell.x);
  normal_heights = vec3(0.0);
  instance_flat = ivec2(id, (instance.mirrored != projection_mirrors(PROJECTION)) ? 1 : 0);
  shell_triangle = int(shell.y + 0.5);
  gl_Position = instance_seen(instance) ? project(world_position, PROJECTION) : vec4(2.0, 2.0, 2.0, 1.0);
}
