// Arithmetic of which each step needs the one before (addon/frame/device_probe.py).
void run(ivec2 pixel)
{
  vec2 r = vec2(pixel) * 0.001;
  for (int k = 0; k < STEPS; k++) {
    r.x = r.x * 0.999 + r.y;
    r.y = r.y * 0.998 - r.x * 0.01;
  }
  out_color = vec4(r, 0.0, 1.0);
}
