// Sums of chunks of CHUNK texels along STEP (addon/kernels/tables.py).
void main()
{
  ivec2 chunk = ivec2(gl_FragCoord.xy);
  ivec2 first = chunk + chunk * STEP * (CHUNK - 1);
  TABLE_VALUE sum = TABLE_VALUE(0);
  for (int k = 0; k < CHUNK; k++) {
    ivec2 texel = first + k * STEP;
    if (all(lessThan(texel, extent))) {
      sum += summed_fetch(texel);
    }
  }
  out_value = sum;
}
