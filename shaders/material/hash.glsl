// Hashes that Blender's procedural textures are made of. A pattern is the same in both only if every bit is.
// Lookup3 by Bob Jenkins (2006, public domain): its mix() and final() over one to four words.
// PCG in three and four dimensions: Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 2020.

uint hash_rotate(uint x, int bits)
{
  return (x << bits) | (x >> (32 - bits));
}

uint hash_final(uint a, uint b, uint c)
{
  c = (c ^ b) - hash_rotate(b, 14);
  a = (a ^ c) - hash_rotate(c, 11);
  b = (b ^ a) - hash_rotate(a, 25);
  c = (c ^ b) - hash_rotate(b, 16);
  a = (a ^ c) - hash_rotate(c, 4);
  b = (b ^ a) - hash_rotate(a, 14);
  return (c ^ b) - hash_rotate(b, 24);
}

// Jenkins' start value for a key of `words` words.
uint hash_seed(uint words)
{
  return 0xdeadbeefu + (words << 2) + 13u;
}

uint hash_1(uint x)
{
  uint s = hash_seed(1u);
  return hash_final(s + x, s, s);
}

uint hash_2(uint x, uint y)
{
  uint s = hash_seed(2u);
  return hash_final(s + x, s + y, s);
}

uint hash_3(uint x, uint y, uint z)
{
  uint s = hash_seed(3u);
  return hash_final(s + x, s + y, s + z);
}

uint hash_4(uint x, uint y, uint z, uint w)
{
  uint s = hash_seed(4u);
  uint a = s + x;
  uint b = s + y;
  uint c = s + z;
  a = (a - c) ^ hash_rotate(c, 4);
  c += b;
  b = (b - a) ^ hash_rotate(a, 6);
  a += c;
  c = (c - b) ^ hash_rotate(b, 8);
  b += a;
  a = (a - c) ^ hash_rotate(c, 16);
  c += b;
  b = (b - a) ^ hash_rotate(a, 19);
  a += c;
  c = (c - b) ^ hash_rotate(b, 4);
  b += a;
  return hash_final(a + w, b, c);
}

// 0..1, both ends included.
float hash_unit(uint bits)
{
  return float(bits) * (1.0 / 4294967295.0);
}

float hash_float(float k)
{
  return hash_unit(hash_1(floatBitsToUint(k)));
}

float hash_float(vec2 k)
{
  return hash_unit(hash_2(floatBitsToUint(k.x), floatBitsToUint(k.y)));
}

float hash_float(vec3 k)
{
  return hash_unit(hash_3(floatBitsToUint(k.x), floatBitsToUint(k.y), floatBitsToUint(k.z)));
}

float hash_float(vec4 k)
{
  return hash_unit(
      hash_4(floatBitsToUint(k.x), floatBitsToUint(k.y), floatBitsToUint(k.z), floatBitsToUint(k.w)));
}

vec3 hash_color(float k)
{
  return vec3(hash_float(k), hash_float(vec2(k, 1.0)), hash_float(vec2(k, 2.0)));
}

vec3 hash_color(vec2 k)
{
  return vec3(hash_float(k), hash_float(vec3(k, 1.0)), hash_float(vec3(k, 2.0)));
}

vec3 hash_color(vec3 k)
{
  return vec3(hash_float(k), hash_float(vec4(k, 1.0)), hash_float(vec4(k, 2.0)));
}

vec3 hash_color(vec4 k)
{
  return vec3(hash_float(k), hash_float(k.zxwy), hash_float(k.wzyx));
}

// The shifts are arithmetic: the words are signed.
vec2 hash_cell(ivec2 cell)
{
  ivec2 v = cell * 1664525 + 1013904223;
  v.x += v.y * 1664525;
  v.y += v.x * 1664525;
  v ^= v >> 16;
  v.x += v.y * 1664525;
  v.y += v.x * 1664525;
  return vec2(v & 0x7fffffff) * (1.0 / 2147483647.0);
}

vec3 hash_cell(ivec3 cell)
{
  ivec3 v = cell * 1664525 + 1013904223;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v ^= v >> 16;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  return vec3(v & 0x7fffffff) * (1.0 / 2147483647.0);
}

vec4 hash_cell(ivec4 cell)
{
  ivec4 v = cell * 1664525 + 1013904223;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  v ^= v >> 16;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  return vec4(v & 0x7fffffff) * (1.0 / 2147483647.0);
}
