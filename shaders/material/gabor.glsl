// Gabor noise: Lagae et al., "Procedural noise using sparse Gabor convolution", 2009, with the same number of impulses in
// every cell and weights of one or minus one (Tavernier et al. 2019), as a complex number, so that it has phase and
// intensity (Tricard et al., "Procedural phasor noise", 2019). Bit for bit as in Blender.
#include "lib/math.glsl"
#include "material/hash.glsl"

#define GABOR_IMPULSES 8

// A wave along `wave`, cycles per unit, below a Gaussian that a Hann window ends at distance 1.
vec2 gabor_kernel(float distance_squared, float cycles)
{
  float window = 0.5 + 0.5 * cos(PI * distance_squared);
  float angle = 2.0 * PI * cycles;
  return exp(-PI * distance_squared) * window * vec2(cos(angle), sin(angle));
}

vec2 gabor_cell_2d(vec2 cell, vec2 position, float frequency, float isotropy, float orientation)
{
  vec2 sum = vec2(0.0);
  for (int i = 0; i < GABOR_IMPULSES; i++) {
    float turn = (hash_float(vec3(cell, float(3 * i))) - 0.5) * PI;
    vec3 seed = vec3(cell, float(3 * i + 1));
    vec2 offset = position - vec2(hash_float(seed), hash_float(seed.zxy));
    float distance_squared = dot(offset, offset);
    if (distance_squared < 1.0) {
      float angle = orientation + turn * isotropy;
      float weight = (hash_float(vec3(cell, float(3 * i + 2))) < 0.5) ? -1.0 : 1.0;
      sum += weight * gabor_kernel(distance_squared, frequency * dot(offset, vec2(cos(angle), sin(angle))));
    }
  }
  return sum;
}

// The direction of an impulse's wave, turned at random by up to half a turn in both spherical angles.
vec3 gabor_direction(vec3 orientation, float isotropy, vec4 seed)
{
  if (isotropy == 0.0) {
    return orientation;
  }
  float azimuth = acos(clamp(orientation.x / max(length(orientation.xy), 1e-20), -1.0, 1.0));
  azimuth = (orientation.y < 0.0) ? -azimuth : azimuth;
  vec2 turn = vec2(hash_float(seed), hash_float(seed.zxwy)) * PI * isotropy;
  float inclination = acos(clamp(orientation.z, -1.0, 1.0)) + turn.x;
  azimuth += turn.y;
  return vec3(sin(inclination) * cos(azimuth), sin(inclination) * sin(azimuth), cos(inclination));
}

vec2 gabor_cell_3d(vec3 cell, vec3 position, float frequency, float isotropy, vec3 orientation)
{
  vec2 sum = vec2(0.0);
  for (int i = 0; i < GABOR_IMPULSES; i++) {
    vec3 direction = gabor_direction(orientation, isotropy, vec4(cell, float(3 * i)));
    vec3 offset = position - hash_color(vec4(cell, float(3 * i + 1)));
    float distance_squared = dot(offset, offset);
    if (distance_squared < 1.0) {
      float weight = (hash_float(vec4(cell, float(3 * i + 2))) < 0.5) ? -1.0 : 1.0;
      sum += weight * gabor_kernel(distance_squared, frequency * dot(offset, direction));
    }
  }
  return sum;
}

// Six standard deviations of the noise reach from one end to the other; `energy`: integral of a squared kernel.
void gabor_outputs(vec2 noise, float energy, out float value, out float phase, out float intensity)
{
  float range = 6.0 * sqrt(float(GABOR_IMPULSES) * 0.5 * energy);
  value = noise.y / range * 0.5 + 0.5;
  phase = (atan(noise.y, noise.x) + PI) / (2.0 * PI);
  intensity = length(noise) / range;
}

void texture_gabor_2d(vec3 vector, float scale, float frequency, float anisotropy, float orientation_2d,
                      vec3 orientation_3d, out float value, out float phase, out float intensity)
{
  vec2 place = vector.xy * scale;
  vec2 cell = floor(place);
  vec2 noise = vec2(0.0);
  for (int j = -1; j <= 1; j++) {
    for (int i = -1; i <= 1; i++) {
      vec2 step = vec2(float(i), float(j));
      noise += gabor_cell_2d(cell + step, place - cell - step, max(frequency, 0.001),
                             1.0 - clamp(anisotropy, 0.0, 1.0), orientation_2d);
    }
  }
  gabor_outputs(noise, 0.25, value, phase, intensity);
}

void texture_gabor_3d(vec3 vector, float scale, float frequency, float anisotropy, float orientation_2d,
                      vec3 orientation_3d, out float value, out float phase, out float intensity)
{
  vec3 place = vector * scale;
  vec3 cell = floor(place);
  vec3 direction = safe_normalize(orientation_3d);
  vec2 noise = vec2(0.0);
  for (int k = -1; k <= 1; k++) {
    for (int j = -1; j <= 1; j++) {
      for (int i = -1; i <= 1; i++) {
        vec3 step = vec3(float(i), float(j), float(k));
        noise += gabor_cell_3d(cell + step, place - cell - step, max(frequency, 0.001),
                               1.0 - clamp(anisotropy, 0.0, 1.0), direction);
      }
    }
  }
  gabor_outputs(noise, 0.17677670, value, phase, intensity);
}
