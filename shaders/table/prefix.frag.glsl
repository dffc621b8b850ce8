// Sums up to and including each texel along STEP: those of its own chunk, and of all chunks before it if the image has
// more than one (addon/kernels/tables.py).
void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  ivec2 along = STEP;
  int place = texel.x * along.x + texel.y * along.y;
  int chunk = place / CHUNK;
  TABLE_VALUE sum = TABLE_VALUE(0);
  for (int k = chunk * CHUNK - place; k <= 0; k++) {
    sum += summed_fetch(texel + k * along);
  }
#ifdef CHUNKS
  if (chunk > 0) {
    sum += chunk_sums_fetch(texel + (chunk - 1 - place) * along);
  }
#endif
  out_value = sum;
}
