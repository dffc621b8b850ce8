// A triangle that covers the screen at the depth with which records of one material are marked: others fail the test.
void main()
{
  screen = corner * 0.5 + 0.5;
  gl_Position = vec4(corner, 2.0 * material_depth - 1.0, 1.0);
}
