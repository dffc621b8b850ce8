// Gradient noise: Perlin, "Improving Noise", 2002, in one to four dimensions, with Blender's hashes, gradients and
// scales. Results lie about in -1..1. Coordinates repeat after 100,000 units, where floats have no digits left.
//
// One function for all dimensions, because a driver writes out each call before it sees that `dimensions` is a literal:
// a function per dimension made programs of twenty noises compile ten times longer.

#include "material/hash.glsl"

vec4 noise_fade(vec4 t)
{
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

float noise_signed(float value, uint negative)
{
  return (negative != 0u) ? -value : value;
}

uint noise_hash(uvec4 cell, int dimensions)
{
  if (dimensions == 1) {
    return hash_1(cell.x);
  }
  if (dimensions == 2) {
    return hash_2(cell.x, cell.y);
  }
  return (dimensions == 3) ? hash_3(cell.x, cell.y, cell.z) : hash_4(cell.x, cell.y, cell.z, cell.w);
}

// The slope that belongs to a corner, times the way from it.
float noise_gradient(uint hash, vec4 p, int dimensions)
{
  if (dimensions == 1) {
    return noise_signed(1.0 + float(hash & 7u), hash & 8u) * p.x;
  }
  if (dimensions == 2) {
    bool low = (hash & 7u) < 4u;
    return noise_signed(low ? p.x : p.y, hash & 1u) + noise_signed(2.0 * (low ? p.y : p.x), hash & 2u);
  }
  if (dimensions == 3) {
    uint h = hash & 15u;
    float u = (h < 8u) ? p.x : p.y;
    float v = (h < 4u) ? p.y : ((h == 12u || h == 14u) ? p.x : p.z);
    return noise_signed(u, h & 1u) + noise_signed(v, h & 2u);
  }
  uint h = hash & 31u;
  float u = (h < 24u) ? p.x : p.y;
  float v = (h < 16u) ? p.y : p.z;
  float s = (h < 8u) ? p.z : p.w;
  return noise_signed(u, h & 1u) + noise_signed(v, h & 2u) + noise_signed(s, h & 4u);
}

float noise_scale(int dimensions)
{
  return (dimensions == 1) ? 0.2500 : ((dimensions == 2) ? 0.6616 : ((dimensions == 3) ? 0.9820 : 0.8344));
}

float perlin_noise(vec4 position, int dimensions)
{
  // fmod() of C, whose result has the sign of its first argument.
  vec4 p = position - 100000.0 * trunc(position / 100000.0);
  p += 0.5 * vec4(greaterThanEqual(abs(position), vec4(1000000.0)));
  vec4 corner = floor(p);
  vec4 f = p - corner;
  vec4 t = noise_fade(f);
  uvec4 cell = uvec4(ivec4(corner));
  float sum = 0.0;
  for (int k = 0; k < (1 << dimensions); k++) {
    vec4 step = vec4(float(k & 1), float((k >> 1) & 1), float((k >> 2) & 1), float(k >> 3));
    vec4 shares = mix(vec4(1.0) - t, t, step);
    float share = shares.x;
    share *= (dimensions > 1) ? shares.y : 1.0;
    share *= (dimensions > 2) ? shares.z : 1.0;
    share *= (dimensions > 3) ? shares.w : 1.0;
    sum += share * noise_gradient(noise_hash(cell + uvec4(step), dimensions), f - step, dimensions);
  }
  return noise_scale(dimensions) * sum;
}
