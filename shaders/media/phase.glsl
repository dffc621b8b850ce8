// Phase functions: density per steradian of light that goes on at an angle of cosine `mu` to where it went. Each
// integrates to 1 over all directions.
//
// Henyey & Greenstein 1941; Rayleigh 1871; Draine 2003; Fournier & Forand 1994 with its parameters from the share that is
// scattered backwards; Mie scattering of droplets as a mix of the first and the third (Jendersie & d'Eon 2023).
// MEDIA_ONE_LOBE: all media of the scene scatter by the first one.
#include "lib/math.glsl"

#define PHASE_HENYEY_GREENSTEIN 0
#define PHASE_FOURNIER_FORAND 1
#define PHASE_DRAINE 2
#define PHASE_RAYLEIGH 3
#define PHASE_MIE 4

float phase_henyey_greenstein(float g, float mu)
{
  float base = max(1.0 + g * g - 2.0 * g * mu, 1e-7);
  return (1.0 - g * g) / (4.0 * PI * base * sqrt(base));
}

float phase_draine(float g, float alpha, float mu)
{
  return phase_henyey_greenstein(g, mu) * (1.0 + alpha * mu * mu) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0);
}

// `values`: index of the particles, exponent v, (d180^-v - 1) / (d180 - 1).
float phase_fournier_forand(vec3 values, float mu)
{
  float square = max(0.5 * (1.0 - mu), 1e-8);  // sin^2 of half the angle
  float v = values.y;
  float d = 4.0 * square / (3.0 * (values.x - 1.0) * (values.x - 1.0));
  float tail = (3.0 * mu * mu - 1.0) * values.z / (16.0 * PI);
  float apart = d - 1.0;
  if (abs(apart) < 1e-2) {  // the limit of what follows
    return max(v * ((v - 1.0) - (v + 1.0) / square) / (8.0 * PI) + tail, 0.0);
  }
  float power = pow(d, v);
  float first = v * -apart - (1.0 - power);
  float second = (d * (1.0 - power) + v * apart) / square;
  return max((first + second) / (4.0 * PI * apart * apart * power) + tail, 0.0);
}

float phase_value(int kind, float g, vec4 values, float mu)
{
#ifndef MEDIA_ONE_LOBE
  if (kind == PHASE_RAYLEIGH) {
    return 3.0 / (16.0 * PI) * (1.0 + mu * mu);
  }
  if (kind == PHASE_DRAINE) {
    return phase_draine(g, values.x, mu);
  }
  if (kind == PHASE_FOURNIER_FORAND) {
    return phase_fournier_forand(values.xyz, mu);
  }
  if (kind == PHASE_MIE) {
    return mix(phase_henyey_greenstein(values.x, mu), phase_draine(values.y, values.z, mu), values.w);
  }
#endif
  return phase_henyey_greenstein(g, mu);
}

// Anisotropy of the lobe of Henyey & Greenstein by which directions of a phase function are drawn.
float phase_lobe(int kind, float g, vec4 values)
{
#ifdef MEDIA_ONE_LOBE
  return g;
#endif
  if (kind == PHASE_RAYLEIGH) {
    return 0.0;
  }
  if (kind == PHASE_FOURNIER_FORAND) {
    return 0.8;
  }
  return (kind == PHASE_MIE) ? 0.9 * mix(values.x, values.y, values.w) : g;
}

// Direction in proportion to Henyey & Greenstein's function; `u` uniform.
vec3 phase_direction(float g, vec3 direction, vec2 u)
{
  float mu = 1.0 - 2.0 * u.x;
  if (abs(g) > 1e-3) {
    float root = (1.0 - g * g) / (1.0 + g - 2.0 * g * u.x);
    mu = clamp((1.0 + g * g - root * root) / (2.0 * g), -1.0, 1.0);
  }
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(direction, tangent, bitangent);
  float across = sqrt(max(1.0 - mu * mu, 0.0));
  float turn = 2.0 * PI * u.y;
  return safe_normalize(mu * direction + across * (cos(turn) * tangent + sin(turn) * bitangent));
}
