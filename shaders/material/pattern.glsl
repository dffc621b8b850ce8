// Textures that repeat or run: checker, brick, gradient, magic.

#include "lib/color.glsl"
#include "lib/math.glsl"

float pattern_parity(float coordinate)
{
  // Off the whole numbers, where rounding would decide between two neighbouring fields.
  float cell = floor((coordinate + 0.000001) * 0.999999);
  return cell - 2.0 * floor(0.5 * cell);
}

void checker_texture(vec3 vector, vec3 color1, vec3 color2, float scale, out vec3 color, out float value)
{
  vec3 p = vector * scale;
  float x = pattern_parity(p.x);
  float y = pattern_parity(p.y);
  float z = pattern_parity(p.z);
  value = (float(x == y) == z) ? 1.0 : 0.0;
  color = (value == 1.0) ? color1 : color2;
}

// 0..1, by Hugo Elias' integer noise.
float brick_shade(int row, int brick)
{
  uint n = (uint((row << 16) + (brick & 65535)) + 1013u) & 0x7fffffffu;
  n = (n >> 13) ^ n;
  uint bits = (n * (n * n * 60493u + 19990303u) + 1376312589u) & 0x7fffffffu;
  return 0.5 * float(bits) / 1073741824.0;
}

bool brick_every(int row, float frequency)
{
  return float(row) - frequency * floor(float(row) / frequency) == 0.0;
}

void brick_texture(vec3 vector, vec3 color1, vec3 color2, vec3 mortar_color, float scale, float mortar_size,
                   float mortar_smooth, float bias, float brick_width, float row_height, float offset_amount,
                   float offset_frequency, float squash_amount, float squash_frequency, out vec3 color,
                   out float mortar)
{
  vec3 p = vector * scale;
  int row = int(floor((row_height != 0.0) ? p.y / row_height : 0.0));
  float width = brick_width;
  float offset = 0.0;
  if (offset_frequency != 0.0 && squash_frequency != 0.0) {
    width *= brick_every(row, squash_frequency) ? squash_amount : 1.0;
    offset = brick_every(row, offset_frequency) ? width * offset_amount : 0.0;
  }
  int brick = int(floor((width != 0.0) ? (p.x + offset) / width : 0.0));
  float x = p.x + offset - width * float(brick);
  float y = p.y - row_height * float(row);
  float tint = clamp(brick_shade(row, brick) + bias, 0.0, 1.0);
  float edge = min(min(x, y), min(width - x, row_height - y));
  mortar = 0.0;
  if (edge < mortar_size) {
    float depth = 1.0 - edge / mortar_size;
    mortar = (mortar_smooth == 0.0) ? 1.0 : smoothstep(0.0, 1.0, depth / mortar_smooth);
  }
  color = mix(mix(color1, color2, tint), mortar_color, mortar);
}

void gradient_linear(vec3 p, out vec3 color, out float value)
{
  value = clamp(p.x, 0.0, 1.0);
  color = vec3(value);
}

void gradient_quadratic(vec3 p, out vec3 color, out float value)
{
  float r = max(p.x, 0.0);
  value = clamp(r * r, 0.0, 1.0);
  color = vec3(value);
}

void gradient_easing(vec3 p, out vec3 color, out float value)
{
  value = smoothstep(0.0, 1.0, p.x);
  color = vec3(value);
}

void gradient_diagonal(vec3 p, out vec3 color, out float value)
{
  value = clamp(0.5 * (p.x + p.y), 0.0, 1.0);
  color = vec3(value);
}

void gradient_radial(vec3 p, out vec3 color, out float value)
{
  float angle = (p.x == 0.0 && p.y == 0.0) ? 0.0 : atan(p.y, p.x);
  value = clamp(angle / (2.0 * PI) + 0.5, 0.0, 1.0);
  color = vec3(value);
}

// A little less than 1 at the centre, so that unit vectors give 0 in spite of rounding.
void gradient_spherical(vec3 p, out vec3 color, out float value)
{
  value = clamp(0.999999 - length(p), 0.0, 1.0);
  color = vec3(value);
}

void gradient_quadratic_sphere(vec3 p, out vec3 color, out float value)
{
  float r = clamp(0.999999 - length(p), 0.0, 1.0);
  value = r * r;
  color = vec3(value);
}

// Folded sines: each step mixes the three waves into one of them.
void magic_texture(vec3 vector, float scale, float distortion, int depth, out vec3 color, out float value)
{
  // Sines repeat: small angles keep the digits of large coordinates.
  vec3 p = vector * scale;
  p -= 2.0 * PI * trunc(p / (2.0 * PI));
  float x = sin(5.0 * (p.x + p.y + p.z));
  float y = cos(5.0 * (-p.x + p.y - p.z));
  float z = -cos(5.0 * (-p.x - p.y + p.z));
  if (depth > 0) {
    x *= distortion;
    y = -cos(x - y * distortion + z * distortion) * distortion;
    z *= distortion;
  }
  if (depth > 1) {
    x = cos(x - y - z) * distortion;
  }
  if (depth > 2) {
    z = sin(-x - y - z) * distortion;
  }
  if (depth > 3) {
    x = -cos(-x + y - z) * distortion;
  }
  if (depth > 4) {
    y = -sin(-x + y + z) * distortion;
  }
  if (depth > 5) {
    y = -cos(-x + y + z) * distortion;
  }
  if (depth > 6) {
    x = cos(x + y + z) * distortion;
  }
  if (depth > 7) {
    z = sin(x + y - z) * distortion;
  }
  if (depth > 8) {
    x = -cos(-x - y + z) * distortion;
  }
  if (depth > 9) {
    y = -sin(x - y + z) * distortion;
  }
  vec3 waves = vec3(x, y, z);
  color = vec3(0.5) - ((distortion != 0.0) ? waves / (2.0 * distortion) : waves);
  value = vector_average(color);
}
