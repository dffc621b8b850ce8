// Random and low-discrepancy numbers per pixel. Hash: PCG3D (Jarzynski & Olano, JCGT 9(3), 2020).

uvec3 hash3(uvec3 v)
{
  v = v * 1664525u + uvec3(1013904223u);
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v ^= v >> 16u;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  return v;
}

float to_unit(uint bits)
{
  return float(bits >> 8u) * (1.0 / 16777216.0);
}

// Bit reversal: the van der Corput sequence, first dimension of Sobol'.
uint reverse_bits(uint x)
{
  x = ((x >> 1u) & 0x55555555u) | ((x & 0x55555555u) << 1u);
  x = ((x >> 2u) & 0x33333333u) | ((x & 0x33333333u) << 2u);
  x = ((x >> 4u) & 0x0F0F0F0Fu) | ((x & 0x0F0F0F0Fu) << 4u);
  x = ((x >> 8u) & 0x00FF00FFu) | ((x & 0x00FF00FFu) << 8u);
  return (x >> 16u) | (x << 16u);
}

// Second dimension of Sobol': Pascal's triangle modulo 2 times the bits, in halves of halves.
uint second_bits(uint x)
{
  x ^= (x >> 16u) & 0x0000FFFFu;
  x ^= (x >> 8u) & 0x00FF00FFu;
  x ^= (x >> 4u) & 0x0F0F0F0Fu;
  x ^= (x >> 2u) & 0x33333333u;
  x ^= (x >> 1u) & 0x55555555u;
  return reverse_bits(x);
}

// Owen scrambling by hashing (Burley 2020).
uint owen_scramble(uint x, uint seed)
{
  x = reverse_bits(x) + seed;
  x ^= x * 0x6C50B47Cu;
  x ^= x * 0xB82F1E52u;
  x ^= x * 0xC7AFE638u;
  x ^= x * 0x8D22F6E6u;
  return reverse_bits(x);
}

// A number of this sample, from its unscrambled Sobol' bits, with a scramble of its own per pixel or layer (`salt`).
float scrambled(int bits, uint salt)
{
  return to_unit(owen_scramble(uint(bits), salt));
}

// A number of this sample that is stratified over the samples and independent of those with other salts: the sequence
// is also shuffled, since two scrambles of one sequence fall into the same or into opposite halves for ever.
float shuffled(int index, uvec2 salt)
{
  return to_unit(owen_scramble(reverse_bits(owen_scramble(uint(index), salt.y)), salt.x));
}

// Bits of a pixel, a sample and a seed, to draw from by hashing again; those of another `purpose` (below 1,024) are
// independent.
uvec3 roll_of(ivec2 pixel, int sample_number, int seed, int purpose)
{
  return hash3(uvec3(uvec2(pixel), uint(sample_number * 1024 + purpose) + uint(seed) * 0x9E3779B1u));
}

// Draws one of many in proportion to their weights, as they come: whether this one replaces the one kept so far. What
// is left of the uniform number `choice` decides on the next (weighted reservoir sampling, Chao 1982).
bool reservoir_takes(float weight, inout float total, inout float choice)
{
  total += weight;
  float p = weight / total;
  bool taken = choice < p;
  choice = taken ? choice / p : (choice - p) / max(1.0 - p, 1e-7);
  return taken;
}
