// What the summed-area table of variance soft shadow maps adds up, in 32-bit integers: q, q^2, q x, q y.
//
// The moments with x and y give the mean square of the height above any plane, so a tilted receiver is no different
// from a parallel one. q counts from 0 to the largest of its view; bits are such that the sums over a cell of 64x64
// texels fit.
#include "vssm/range.glsl"

float vssm_dither(ivec2 texel)
{
  uint h = uint(texel.x) * 0x9E3779B1u ^ uint(texel.y) * 0x85EBCA77u;
  h = (h ^ (h >> 15u)) * 0x2C1B3C6Du;
  h = (h ^ (h >> 12u)) * 0x297A2D39u;
  return float((h ^ (h >> 15u)) >> 8u) / 16777216.0;
}

uvec4 vssm_moments(ivec2 texel, float range)
{
  vec4 caster = depth_maps_fetch(texel);
  if (caster.w <= 0.0) {
    return uvec4(0u);
  }
  uint q = uint(clamp(caster.x / range, 0.0, 1.0) * VSSM_Q + 0.5);
  float exact = float(q) / VSSM_Q;
  // A constant map would round its squares all one way: the dither makes the error's mean zero.
  // By the texel's place in its view: equal maps have equal tables wherever they lie.
  uint squared = uint(exact * exact * VSSM_SQUARED + vssm_dither(texel & ((1 << top_level) - 1)));
  return uvec4(q, squared, q * uint(texel.x), q * uint(texel.y));
}

// Of a block of texels.
uvec4 table_source(ivec2 block)
{
  ivec2 texel = TABLE_BLOCK * block;
  float range = vssm_range(texel);
  uvec4 sum = uvec4(0u);
  for (int k = 0; k < TABLE_BLOCK * TABLE_BLOCK; k++) {
    sum += vssm_moments(texel + ivec2(k % TABLE_BLOCK, k / TABLE_BLOCK), range);
  }
  return sum;
}
