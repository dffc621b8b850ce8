// Vertices of an edited object with the distances that its regions and constraints have along the surface.
#include "lib/instance.glsl"
#include "lib/projection.glsl"
#include "generated/copied"

void main()
{
  Instance instance = instance_read(instance_row);
  world_position = instance_position(instance, position);
  copy_distances();
  gl_Position = instance_seen(instance) ? project(world_position, PROJECTION) : vec4(2.0, 2.0, 2.0, 1.0);
}
