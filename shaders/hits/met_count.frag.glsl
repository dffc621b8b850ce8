// How many materials rays have met.
void main()
{
  int found = 0;
  for (int k = 0; k < material_count; k++) {
    found += int(materials_met_fetch(ivec2(k & 255, k >> 8)).x);
  }
  out_count = float(found);
}
