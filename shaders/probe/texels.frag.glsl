// Texels far apart, read in an order that no neighbour shares (addon/frame/device_probe.py).
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 sum = vec4(0.0);
  for (int k = 0; k < READS; k++) {
    int place = (pixel.x * 1973 + pixel.y * 9277 + k * 2657) & (SIDE * SIDE - 1);
    sum += PROBED(ivec2(place & (SIDE - 1), place / SIDE));
  }
  out_color = sum / float(READS);
}
