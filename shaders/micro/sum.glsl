// Irradiance from a micro-buffer: all pixels have the same share. Alpha: the share of the hemisphere that is filled.
#define MICRO_SUM(corner) \
  vec4 arriving = vec4(0.0); \
  for (int i = 0; i < micro_side * micro_side; i++) { \
    uint word = MICRO_WORD((corner) + ivec2(i % micro_side, i / micro_side)); \
    if (word != NOTHING) { \
      arriving += vec4(radiance_texel(word & ((1u << uint(id_bits)) - 1u)).rgb, 1.0); \
    } \
  } \
  arriving *= vec4(vec3(PI), 1.0) / float(micro_side * micro_side);
