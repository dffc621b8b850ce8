// Materials that share a program and its block of values (addon/surfaces/hits.py): w of `inside_of_materials` holds which of them
// leads, and in the bits above where a material's values begin.
int shared_number(int material_index)
{
  return int(inside_of_materials_fetch(ivec2(material_index & 255, material_index >> 8)).w + 0.5);
}

int shared_leader(int material_index)
{
  return shared_number(material_index) & 8191;
}

int shared_base(int material_index)
{
  return shared_number(material_index) >> 13;
}

// Depth of the records of a material.
float shared_depth(int material_index)
{
  return 0.5 + float(shared_leader(material_index) + 1) * (1.0 / 16384.0);
}
