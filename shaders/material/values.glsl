// Constants of a material's tree. Materials of one program may share a block, in which each has rows of its own
// (addon/scene/materials.py): there MATERIAL_BASE is the first of them.
#ifndef MATERIAL_BASE
#define MATERIAL_BASE 0
#endif

vec4 material_value(int row)
{
  return material_values.value[MATERIAL_BASE + row];
}
