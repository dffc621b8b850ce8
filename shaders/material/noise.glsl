// Noise Texture: fractal sums of gradient noise.
// Musgrave in Ebert et al., "Texturing and Modeling", 2003, chapter 16: the five sums and their names.
// `dimensions` and `type` are literals, so a compiler keeps the one path that is meant. A coordinate of one dimension
// is W, of two are X and Y, of four X, Y, Z and W.

#include "lib/math.glsl"
#include "material/perlin.glsl"

#define NOISE_FBM 0
#define NOISE_MULTIFRACTAL 1
#define NOISE_HYBRID_MULTIFRACTAL 2
#define NOISE_RIDGED_MULTIFRACTAL 3
#define NOISE_HETERO_TERRAIN 4

// The sum of type `type` over the octaves of `detail`, whose last fades in with the fraction, or the noise alone where
// `alone`. One loop for all types, so that the noise itself is written once (see perlin.glsl).
float noise_sum(vec4 start, int dimensions, int type, bool normalized, float detail, float roughness,
                float lacunarity, float offset, float gain, bool alone)
{
  int whole = int(detail);
  float fraction = (type == NOISE_RIDGED_MULTIFRACTAL) ? 0.0 : detail - floor(detail);
  int last = (fraction > 0.0) ? whole + 1 : whole;
  vec4 p = start;
  float power = 1.0;
  float powers = 0.0;
  float whole_powers = 0.0;
  float weight = 1.0;  // what the octave before leaves to this one
  float value = (type == NOISE_MULTIFRACTAL) ? 1.0 : 0.0;
  float whole_value = 0.0;
  for (int i = 0; i <= last; i++) {
    float share = (i > whole) ? fraction : 1.0;
    float n = perlin_noise(p, dimensions);
    if (alone) {
      return n;
    }
    if (type == NOISE_FBM) {
      if (i <= whole) {
        whole_value += power * n;
        whole_powers += power;
      }
      value += power * n;
      powers += power;
    }
    else if (type == NOISE_MULTIFRACTAL) {
      value *= share * power * n + 1.0;
    }
    else if (type == NOISE_HYBRID_MULTIFRACTAL) {
      if (weight <= 0.001) {
        break;
      }
      float signal = (n + offset) * power;
      weight = min(weight, 1.0);
      value += share * weight * signal;
      weight *= gain * signal;
    }
    else if (type == NOISE_RIDGED_MULTIFRACTAL) {
      float signal = offset - abs(n);
      signal *= signal * weight;
      value += signal * power;
      weight = clamp(signal * gain, 0.0, 1.0);
    }
    else {
      value += (i == 0) ? n + offset : share * (n + offset) * power * value;
    }
    power *= roughness;
    p *= lacunarity;
  }
  if (type == NOISE_FBM) {
    float all = normalized ? 0.5 * value / powers + 0.5 : value;
    float before = normalized ? 0.5 * whole_value / whole_powers + 0.5 : whole_value;
    return mix(before, all, fraction);
  }
  return value;
}

// Far places that serve as other seeds; one dimension has its own hash.
vec4 noise_seed(int seed, int dimensions)
{
  float s = float(seed);
  if (dimensions == 1) {
    return vec4(100.0 + 100.0 * hash_float(s), 0.0, 0.0, 0.0);
  }
  return vec4(100.0) + 100.0 * vec4(hash_float(vec2(s, 0.0)), hash_float(vec2(s, 1.0)), hash_float(vec2(s, 2.0)),
                                    hash_float(vec2(s, 3.0)));
}

void noise_texture(vec3 vector, float w, float scale, float detail, float roughness, float lacunarity, float offset,
                   float gain, float distortion, int dimensions, int type, bool normalized, bool color_used,
                   out float value, out vec3 color)
{
  vec4 p = scale * ((dimensions == 1) ? vec4(w, 0.0, 0.0, 0.0) : vec4(vector, w));
  float octaves = clamp(detail, 0.0, 15.0);
  float rough = max(roughness, 0.0);
  vec4 start = p;
  color = vec3(0.0);
  // What pushes the point along its axes, then the channels: one loop, since each call of the noise is written out.
  for (int k = (distortion != 0.0) ? -dimensions : 0; k < (color_used ? 3 : 1); k++) {
    bool pushes = k < 0;
    vec4 q = pushes ? start : p;
    if (k != 0) {
      q += noise_seed(pushes ? dimensions + k : dimensions + k - 1, dimensions);
    }
    float n = noise_sum(q, dimensions, type, normalized, octaves, rough, lacunarity, offset, gain, pushes);
    if (pushes) {
      int axis = dimensions + k;
      p += distortion * n * vec4(float(axis == 0), float(axis == 1), float(axis == 2), float(axis == 3));
    }
    else if (k == 0) {
      color = vec3(n);
    }
    else if (k == 1) {
      color.y = n;
    }
    else {
      color.z = n;
    }
  }
  value = color.x;
}

void white_noise_texture(vec3 vector, float w, int dimensions, out float value, out vec3 color)
{
  if (dimensions == 1) {
    color = hash_color(w);
  }
  else if (dimensions == 2) {
    color = hash_color(vector.xy);
  }
  else if (dimensions == 3) {
    color = hash_color(vector);
  }
  else {
    color = hash_color(vec4(vector, w));
  }
  value = color.x;
}

#define WAVE_BANDS 0
#define WAVE_RINGS 1

#define WAVE_X 0
#define WAVE_Y 1
#define WAVE_Z 2
#define WAVE_ALL 3  // diagonal bands, spherical rings

#define WAVE_SINE 0
#define WAVE_SAW 1
#define WAVE_TRIANGLE 2

void wave_texture(vec3 vector, float scale, float distortion, float detail, float detail_scale,
                  float detail_roughness, float phase, int type, int bands, int rings, int profile, out vec3 color,
                  out float value)
{
  // Off the whole numbers, where rounding would decide between two neighbouring stripes.
  vec3 p = (vector * scale + vec3(0.000001)) * 0.999999;
  float n;
  if (type == WAVE_BANDS) {
    vec3 along = vec3(float(bands == WAVE_X), float(bands == WAVE_Y), float(bands == WAVE_Z));
    n = dot(p, (bands == WAVE_ALL) ? vec3(10.0) : 20.0 * along);
  }
  else {
    vec3 across = vec3(float(rings != WAVE_X), float(rings != WAVE_Y), float(rings != WAVE_Z));
    n = 20.0 * length(p * across);
  }
  n += phase;
  if (distortion != 0.0) {
    float octaves = clamp(detail, 0.0, 15.0);
    n += distortion
         * (2.0 * noise_sum(vec4(p * detail_scale, 0.0), 3, NOISE_FBM, true, octaves, detail_roughness, 2.0, 0.0, 1.0,
                           false)
            - 1.0);
  }
  if (profile == WAVE_SINE) {
    value = 0.5 + 0.5 * sin(n - 0.5 * PI);
  }
  else {
    n /= 2.0 * PI;
    value = (profile == WAVE_SAW) ? n - floor(n) : 2.0 * abs(n - floor(n + 0.5));
  }
  color = vec3(value);
}
