// Depth comparisons that can be filtered beforehand (Annen et al., "Convolution shadow maps", EGSR 2007): the share of a
// box of texels that is nearer than a depth d, and the mean depth of that share, from means of functions of z alone.
//
//     [z < d]  =  1/2 + 2 sum over k of sin(c_k (d - z)) / c_k,   c_k = (2 k - 1) pi,  k = 1 .. ORDER
//
// sin(c_k (d - z)) separates into products of functions of d and of z. Tile t of the basis images holds, for four
// values of k each, sin(c_k z), cos(c_k z), z sin(c_k z), z cos(c_k z), and the last tile z (addon/kernels/convolution.py).
// Depths are linear and lie in 0.05 .. 0.95: the series has period 2 and flips where |d - z| nears 1.
#include "lib/math.glsl"

#define BASIS_TILES (ORDER + 1)

vec4 basis_frequencies(int group)
{
  return (2.0 * (vec4(0.0, 1.0, 2.0, 3.0) + float(4 * group)) + 1.0) * PI;
}

// `range`: q of the nearest caster and of the farthest receiver, of a view that is a perspective one or not.
float basis_depth(float q, vec2 range, bool perspective)
{
  float z = (range.x - q) / max(range.x - range.y, 1e-30);
  if (perspective) {
    // 1 / q between 1 / range.x and 1 / range.y, without the differences of reciprocals
    z *= range.y / max(q, 1e-30);
  }
  return 0.05 + 0.9 * clamp(z, 0.0, 1.0);
}

// q of a depth.
float basis_q(float depth, vec2 range, bool perspective)
{
  float z = clamp((depth - 0.05) / 0.9, 0.0, 1.0);
  float span = range.x - range.y;
  return perspective ? range.x * range.y / max(range.y + z * span, 1e-30) : range.x - z * span;
}

vec4 basis_values(int tile, float z)
{
  if (tile >= ORDER) {
    return vec4(z, 0.0, 0.0, 0.0);
  }
  vec4 angle = basis_frequencies(tile / 4) * z;
  int kind = tile % 4;
  vec4 value = (kind == 0 || kind == 2) ? sin(angle) : cos(angle);
  return (kind < 2) ? value : value * z;
}
