// Mesh vertex with its instance's transform; used by the surface pass and by casters with alpha.
#include "lib/instance.glsl"
#include "lib/projection.glsl"
#include "generated/attributes"
#include "generated/strands"

void main()
{
  // Where materials share a block, corners drawn together say which rows are theirs (addon/scene/joint_draws.py).
  int id = first_instance + (local_instance & 0x1fffff) + gl_InstanceID;
  Instance instance = instance_read(id);
  world_position = instance_position(instance, position);
  // Between corners normals run as Cycles has them: of unit length in world space where no other object shows this mesh.
  vec3 turned = instance_normal(instance, normal);
  float unit = instance_shares_mesh(id) ? 1.0 : 1.0 / max(length(turned), 1e-30);
  world_normal = turned * unit;
  // Of lengths along normals, a transform by cofactors makes those in world space times its determinant.
  normal_heights.x = dot(world_position - instance_origin(instance), world_normal);
  normal_heights.yz = (instance_volume(instance) * unit) * envelope;
  vec3 drawn = world_position;
#ifdef WIDENS_STRANDS
  strand_across = vec4(0.0);
  strand_along = vec3(0.0);
  strand_aside = vec4(0.0);
#endif
#ifdef STRANDS
  for (bool is_strand = envelope.y < 0.0; is_strand; is_strand = false) {
    normal_heights.yz = vec2(0.0);
#ifdef WIDENS_STRANDS
    for (bool widens = film_view.visibility == FLAG_CAMERA; widens; widens = false) {
      StrandVertex strand = strand_vertex(instance, world_position, normal);
      drawn = strand.drawn;
      normal_heights.z = -strand.half_width;
      strand_across = strand.across;
      strand_along = strand.along;
      strand_aside = strand.looks;
    }
#endif
  }
#endif
  instance_flat = ivec2(id, (instance.mirrored != projection_mirrors(PROJECTION)) ? 1 : 0);
#ifdef MATERIAL_BASE
  instance_flat.y += 2 * (first_value + (local_instance >> 21));
#endif
  copy_attributes();
  gl_Position = instance_seen(instance) ? project(drawn, PROJECTION) : vec4(2.0, 2.0, 2.0, 1.0);
}
