// Mesh vertex of a view that asks where surfaces lie, not what they are.
#include "lib/instance.glsl"
#include "lib/projection.glsl"

void main()
{
  Instance instance = instance_read(first_instance + (local_instance & 0x1fffff) + gl_InstanceID);
  world_position = instance_position(instance, position);
  gl_Position = instance_seen(instance) ? project(world_position, PROJECTION) : vec4(2.0, 2.0, 2.0, 1.0);
}
