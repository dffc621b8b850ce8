// The plane on top of the blades: the mesh moved out by their height along its normals. Else as surface/surface.vert.glsl.
#include "lib/instance.glsl"
#include "lib/projection.glsl"
#include "generated/attributes"
#include "grass/table.glsl"

void main()
{
  int id = first_instance + local_instance + gl_InstanceID;
  Instance instance = instance_read(id);
  world_position = instance_position(instance, position);
  vec3 turned = instance_normal(instance, normal);
  float unit = instance_shares_mesh(id) ? 1.0 : 1.0 / max(length(turned), 1e-30);
  world_normal = turned * unit;
  world_position += safe_normalize(turned) * grass_of(grass_entry).height;
  normal_heights.x = dot(world_position - instance_origin(instance), world_normal);
  normal_heights.yz = (instance_volume(instance) * unit) * envelope;
  instance_flat = ivec2(id, (instance.mirrored != projection_mirrors(PROJECTION)) ? 1 : 0);
#ifdef MATERIAL_BASE
  instance_flat.y += 2 * first_value;
#endif
  copy_attributes();
  gl_Position = instance_seen(instance) ? project(world_position, PROJECTION) : vec4(2.0, 2.0, 2.0, 1.0);
#ifdef CASTS_WHOLE
  // Maps of directions begin at the highest vertex of the scene, above which blades stand.
  gl_Position.z = max(gl_Position.z, -gl_Position.w);
#endif
}
