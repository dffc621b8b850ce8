// 0..1 in steps of a sixteenth in each block of 4 x 4 pixels, neighbours far apart (Bayer).
float dither(ivec2 p)
{
  int x = p.x & 3;
  int y = p.y & 3;
  int v = x ^ y;
  int order = ((v & 1) << 3) | ((y & 1) << 2) | (v & 2) | ((y & 2) >> 1);
  return (float(order) + 0.5) / 16.0;
}
