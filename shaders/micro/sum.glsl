// Irradiance from a micro-buffer: all pixels have the same share. Alpha: the share of the hemisphere that is filled.
// A program that includes this defines MICRO_WORD(texel), what a pixel of micro-buffers holds, and `radiance_texel`.
vec4 micro_sum(ivec2 corner)
{
  vec4 sum = vec4(0.0);
  for (int i = 0; i < micro_side * micro_side; i++) {
    uint word = MICRO_WORD(corner + ivec2(i % micro_side, i / micro_side));
    if (word != NOTHING) {
      sum += vec4(radiance_texel(word & ((1u << uint(id_bits)) - 1u)).rgb, 1.0);
    }
  }
  return sum * vec4(vec3(PI), 1.0) / float(micro_side * micro_side);
}
