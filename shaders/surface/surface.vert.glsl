// Mesh vertex with its instance's transform; used by the surface pass and by casters with alpha.
#include "lib/instance.glsl"
#include "lib/projection.glsl"
#include "generated/attributes"

void main()
{
  int id = first_instance + local_instance + gl_InstanceID;
  Instance instance = instance_read(id);
  world_position = instance_position(instance, position);
  world_normal = instance_normal(instance, normal);
  normal_height = dot(world_position - instance_origin(instance), world_normal);
  instance_flat = ivec2(id, instance.mirrored ? 1 : 0);
  copy_attributes();
  gl_Position = instance_seen(instance) ? project(world_position, PROJECTION) : vec4(2.0, 2.0, 2.0, 1.0);
}
