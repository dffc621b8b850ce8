// Constants of a material's tree. Materials of one program may share a block, in which each has rows of its own
// (addon/scene/materials.py): there MATERIAL_BASE is the first of them.
#ifndef MATERIAL_BASE
#define MATERIAL_BASE 0
#endif

vec4 material_value(int row)
{
  return material_values.value[MATERIAL_BASE + row];
}

// Of a table that begins at row `first`. Those that the block has no room for stand in the program's text, and count
// from -1 downwards (addon/materials/values.py).
vec4 material_row(int first, int row)
{
#ifdef MATERIAL_TEXT_ROWS
  if (first < 0) {
    return material_text_row(row - first - 1);
  }
#endif
  return material_value(first + row);
}
