// A triangle that covers the screen at the depth with which records of the materials of one program are marked: others
// fail the test. Where no ray has met one of them, it lies beside the screen.
void main()
{
  screen = corner * 0.5 + 0.5;
  gl_Position = vec4(corner, 2.0 * material_depth - 1.0, 1.0);
#ifdef ASKS_IF_MET
  if (materials_met_fetch(ivec2(material_number & 255, (material_number >> 8) + ASKS_IF_MET)).x == 0u) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  }
#endif
}
