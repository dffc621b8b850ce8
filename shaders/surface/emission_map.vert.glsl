// A mesh's triangles laid out flat, each on a tile of its own (surface/opacity_map.vert.glsl), where addon/scene/
// emission_maps.py puts them: the tiles of one instance in `shift` cells, those of its other side `other_side` cells above.
#include "lib/instance.glsl"
#include "generated/attributes"

void main()
{
  Instance instance = instance_read(first_instance);
  world_position = instance_position(instance, position);
  world_normal = instance_normal(instance, normal);
  normal_heights = vec3(0.0);
  // Tiles run anticlockwise, so that their front is drawn: the second number turns it around.
  int side = gl_InstanceID & 1;
  instance_flat = ivec2(first_instance, side);
  sample_flat = gl_InstanceID >> 1;
  copy_attributes();
  vec2 place = vec2(0.375 + 0.5 * float(sample_flat & 1) - 0.25 * float(sample_flat >> 1),
                    0.125 + 0.25 * float(sample_flat & 1) + 0.5 * float(sample_flat >> 1));
  vec2 at = cell + shift + vec2(0.0, float(side) * other_side);
  gl_Position = vec4((at + 0.5 - place) * tile_scale - 1.0, 0.5, 1.0);
}
