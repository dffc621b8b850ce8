// A mesh as a first look shows it: its place and its normal, without what its material does to them.
#include "lib/instance.glsl"
#include "lib/projection.glsl"

void main()
{
  Instance instance = instance_read(first_instance + (local_instance & 0x1fffff) + gl_InstanceID);
  world_position = instance_position(instance, position);
  world_normal = instance_normal(instance, normal);
  gl_Position = instance_seen(instance) ? project(world_position, PROJECTION) : vec4(2.0, 2.0, 2.0, 1.0);
}
