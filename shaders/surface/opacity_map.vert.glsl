// A mesh's triangles laid out flat, each on a tile of its own, for each side and sample that addon/scene/opacity_maps.py
// adds up: their numbers are those of the instances drawn.
#include "lib/instance.glsl"
#include "generated/attributes"

void main()
{
  Instance instance = instance_read(first_instance);
  world_position = instance_position(instance, position);
  world_normal = instance_normal(instance, normal);
  normal_heights = vec3(0.0);
  // Tiles run anticlockwise, so that their front is drawn: the second number turns it around.
  instance_flat = ivec2(first_instance, gl_InstanceID & 1);
  sample_flat = gl_InstanceID >> 1;
  copy_attributes();
  // Four places of a cell, no two in a row or column; of cells that the long side cuts, two lie inside.
  vec2 place = vec2(0.375 + 0.5 * float(sample_flat & 1) - 0.25 * float(sample_flat >> 1),
                    0.125 + 0.25 * float(sample_flat & 1) + 0.5 * float(sample_flat >> 1));
  gl_Position = vec4((cell + 0.5 - place) * tile_scale - 1.0, 0.5, 1.0);
}
