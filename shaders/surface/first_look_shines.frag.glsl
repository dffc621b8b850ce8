// Whether anything that a guide knows to emit is seen in a coarse pixel, or half of one beside it: a point of the film that
// is drawn for a pixel may lie so far off (addon/surfaces/first_look.py).
void main()
{
  ivec2 size = glow_size();
  ivec2 first = ivec2(gl_FragCoord.xy) * finer - finer / 2;
  float found = 0.0;
  for (int y = 0; y < 2 * finer && found == 0.0; y++) {
    for (int x = 0; x < 2 * finer && found == 0.0; x++) {
      found = glow_fetch(clamp(first + ivec2(x, y), ivec2(0), size - 1)).w;
    }
  }
  out_shines = found > 0.0 ? 1.0 : 0.0;
}
