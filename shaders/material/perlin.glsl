// Gradient noise: Perlin, "Improving Noise", 2002, in one to four dimensions, with Blender's hashes, gradients and
// scales. Results lie about in -1..1. Coordinates repeat after 100,000 units, where floats have no digits left.

#include "material/hash.glsl"

float noise_fade(float t)
{
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

vec2 noise_fade(vec2 t)
{
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

vec3 noise_fade(vec3 t)
{
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

vec4 noise_fade(vec4 t)
{
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

float noise_signed(float value, uint negative)
{
  return (negative != 0u) ? -value : value;
}

float noise_gradient(uint hash, float x)
{
  return noise_signed(1.0 + float(hash & 7u), hash & 8u) * x;
}

float noise_gradient(uint hash, vec2 p)
{
  bool low = (hash & 7u) < 4u;
  float u = low ? p.x : p.y;
  float v = 2.0 * (low ? p.y : p.x);
  return noise_signed(u, hash & 1u) + noise_signed(v, hash & 2u);
}

float noise_gradient(uint hash, vec3 p)
{
  uint h = hash & 15u;
  float u = (h < 8u) ? p.x : p.y;
  float v = (h < 4u) ? p.y : ((h == 12u || h == 14u) ? p.x : p.z);
  return noise_signed(u, h & 1u) + noise_signed(v, h & 2u);
}

float noise_gradient(uint hash, vec4 p)
{
  uint h = hash & 31u;
  float u = (h < 24u) ? p.x : p.y;
  float v = (h < 16u) ? p.y : p.z;
  float s = (h < 8u) ? p.z : p.w;
  return noise_signed(u, h & 1u) + noise_signed(v, h & 2u) + noise_signed(s, h & 4u);
}

// fmod() of C, whose result has the sign of its first argument.
float noise_period(float p)
{
  float rest = p - 100000.0 * trunc(p / 100000.0);
  return rest + ((abs(p) >= 1000000.0) ? 0.5 : 0.0);
}

float perlin_noise(float position)
{
  float p = noise_period(position);
  float cell = floor(p);
  float f = p - cell;
  uint x = uint(int(cell));
  return 0.25 * mix(noise_gradient(hash_1(x), f), noise_gradient(hash_1(x + 1u), f - 1.0), noise_fade(f));
}

float perlin_noise(vec2 position)
{
  vec2 p = vec2(noise_period(position.x), noise_period(position.y));
  vec2 cell = floor(p);
  vec2 f = p - cell;
  vec2 t = noise_fade(f);
  uvec2 c = uvec2(ivec2(cell));
  float a = mix(noise_gradient(hash_2(c.x, c.y), f), noise_gradient(hash_2(c.x + 1u, c.y), f - vec2(1.0, 0.0)), t.x);
  float b = mix(noise_gradient(hash_2(c.x, c.y + 1u), f - vec2(0.0, 1.0)),
                noise_gradient(hash_2(c.x + 1u, c.y + 1u), f - vec2(1.0, 1.0)), t.x);
  return 0.6616 * mix(a, b, t.y);
}

float perlin_noise(vec3 position)
{
  vec3 p = vec3(noise_period(position.x), noise_period(position.y), noise_period(position.z));
  vec3 cell = floor(p);
  vec3 f = p - cell;
  vec3 t = noise_fade(f);
  uvec3 c = uvec3(ivec3(cell));
  float layers[2];
  for (int k = 0; k < 2; k++) {
    uint z = c.z + uint(k);
    vec3 g = f - vec3(0.0, 0.0, float(k));
    float a = mix(noise_gradient(hash_3(c.x, c.y, z), g),
                  noise_gradient(hash_3(c.x + 1u, c.y, z), g - vec3(1.0, 0.0, 0.0)), t.x);
    float b = mix(noise_gradient(hash_3(c.x, c.y + 1u, z), g - vec3(0.0, 1.0, 0.0)),
                  noise_gradient(hash_3(c.x + 1u, c.y + 1u, z), g - vec3(1.0, 1.0, 0.0)), t.x);
    layers[k] = mix(a, b, t.y);
  }
  return 0.9820 * mix(layers[0], layers[1], t.z);
}

float perlin_noise(vec4 position)
{
  vec4 p = vec4(noise_period(position.x), noise_period(position.y), noise_period(position.z),
                noise_period(position.w));
  vec4 cell = floor(p);
  vec4 f = p - cell;
  vec4 t = noise_fade(f);
  uvec4 c = uvec4(ivec4(cell));
  float layers[4];
  for (int k = 0; k < 4; k++) {
    uint z = c.z + uint(k & 1);
    uint w = c.w + uint(k >> 1);
    vec4 g = f - vec4(0.0, 0.0, float(k & 1), float(k >> 1));
    float a = mix(noise_gradient(hash_4(c.x, c.y, z, w), g),
                  noise_gradient(hash_4(c.x + 1u, c.y, z, w), g - vec4(1.0, 0.0, 0.0, 0.0)), t.x);
    float b = mix(noise_gradient(hash_4(c.x, c.y + 1u, z, w), g - vec4(0.0, 1.0, 0.0, 0.0)),
                  noise_gradient(hash_4(c.x + 1u, c.y + 1u, z, w), g - vec4(1.0, 1.0, 0.0, 0.0)), t.x);
    layers[k] = mix(a, b, t.y);
  }
  return 0.8344 * mix(mix(layers[0], layers[1], t.z), mix(layers[2], layers[3], t.z), t.w);
}
