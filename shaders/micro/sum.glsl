// Irradiance from a micro-buffer: all pixels have the same share. Alpha: the share of the hemisphere that is filled.
// A program that includes this defines MICRO_WORD(texel), what a pixel of micro-buffers holds, and `radiance_texel`.
#ifdef PLACES  // of nodes are bound
#include "lib/random.glsl"
#include "ask/media.glsl"

// What media let pass between a place and the middle of the node that a pixel shows.
vec3 micro_passing(vec3 place, uint word, int pixel)
{
  int index = 3 * int((word & ((1u << uint(id_bits)) - 1u)) >> 1u);
  vec3 path = tree_nodes_fetch(ivec2(index & 2047, index >> 11)).xyz - place;
  float reach = length(path);
  uvec3 salt = hash3(uvec3(floatBitsToUint(place.x), floatBitsToUint(place.y), word + uint(pixel)));
  return media_transmittance(place, path / max(reach, 1e-30), reach, salt.x);
}
#define MICRO_PASSING(place, word, pixel) micro_passing(place, word, pixel)
#else
#define MICRO_PASSING(place, word, pixel) vec3(1.0)
#endif

#ifdef NODE_LOBES
#include "micro/lobe.glsl"
// Of gloss: a pixel is PI / micro_side^2 of the hemisphere wide.
vec3 micro_lobes(ivec2 corner, MicroFrame f)
{
  vec3 sum = vec3(0.0);
  float count = float(micro_side * micro_side);
  for (int i = 0; i < micro_side * micro_side; i++) {
    ivec2 pixel = ivec2(i % micro_side, i / micro_side);
    uint word = MICRO_WORD(corner + pixel);
    if (word != NOTHING) {
      vec3 weight;
      vec3 radiance = lobe_radiance(word & ((1u << uint(id_bits)) - 1u), -micro_ray(f, pixel, weight), 0.25 / count);
      sum += weight * radiance * MICRO_PASSING(f.place, word, i);
    }
  }
  return sum * (PI / count);
}
#endif

// `place`: from where it was drawn.
vec4 micro_sum(ivec2 corner, vec3 place)
{
  vec4 sum = vec4(0.0);
  for (int i = 0; i < micro_side * micro_side; i++) {
    uint word = MICRO_WORD(corner + ivec2(i % micro_side, i / micro_side));
    if (word != NOTHING) {
      vec3 radiance = radiance_texel(word & ((1u << uint(id_bits)) - 1u)).rgb;
      sum += vec4(radiance * MICRO_PASSING(place, word, i), 1.0);
    }
  }
  return sum * vec4(vec3(PI), 1.0) / float(micro_side * micro_side);
}

#ifdef WAYS
// Mean of the directions that the irradiance comes from, times its luminance.
vec3 micro_way(ivec2 corner, MicroFrame f)
{
  vec3 sum = vec3(0.0);
  for (int i = 0; i < micro_side * micro_side; i++) {
    ivec2 pixel = ivec2(i % micro_side, i / micro_side);
    uint word = MICRO_WORD(corner + pixel);
    if (word != NOTHING) {
      vec3 weight;
      vec3 radiance = radiance_texel(word & ((1u << uint(id_bits)) - 1u)).rgb * MICRO_PASSING(f.place, word, i);
      sum += luminance(radiance) * micro_ray(f, pixel, weight);
    }
  }
  return sum * (PI / float(micro_side * micro_side));
}
#endif
