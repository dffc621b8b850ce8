// Vector Math node, one function per operation. Every function is total, as in Cycles: division by zero and roots of
// negative numbers give 0. Operations with a number for a result give it alone.

#include "lib/math.glsl"
#include "material/math.glsl"

vec3 vector_divided(vec3 a, vec3 b)
{
  return vec3(safe_divide(a.x, b.x), safe_divide(a.y, b.y), safe_divide(a.z, b.z));
}

vec3 vector_unit(vec3 v)
{
  float size = length(v);
  return (size > 0.0) ? v / size : vec3(0.0);
}

void vector_add(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = a + b;
}

void vector_subtract(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = a - b;
}

void vector_multiply(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = a * b;
}

void vector_divide(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = vector_divided(a, b);
}

void vector_multiply_add(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = a * b + c;
}

void vector_cross_product(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = cross(a, b);
}

void vector_project(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = safe_divide(dot(a, b), dot(b, b)) * b;
}

void vector_reflect(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  vec3 n = vector_unit(b);
  result = a - 2.0 * dot(n, a) * n;
}

void vector_refract(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  vec3 n = vector_unit(b);
  float d = dot(n, a);
  float k = 1.0 - scale * scale * (1.0 - d * d);
  result = (k < 0.0) ? vec3(0.0) : scale * a - (scale * d + sqrt(k)) * n;
}

void vector_faceforward(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = (dot(c, b) < 0.0) ? a : -a;
}

void vector_scale(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = a * scale;
}

void vector_normalize(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = vector_unit(a);
}

void vector_absolute(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = abs(a);
}

void vector_power(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = vec3(safe_power(a.x, b.x), safe_power(a.y, b.y), safe_power(a.z, b.z));
}

void vector_sign(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = sign(a);
}

void vector_minimum(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = min(a, b);
}

void vector_maximum(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = max(a, b);
}

void vector_round(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = floor(a + vec3(0.5));
}

void vector_floor(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = floor(a);
}

void vector_ceil(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = ceil(a);
}

void vector_fraction(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = a - floor(a);
}

void vector_modulo(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  // The sign is that of the first vector: fmod() of C.
  vec3 rest = a - b * trunc(vector_divided(a, b));
  result = vec3((b.x != 0.0) ? rest.x : 0.0, (b.y != 0.0) ? rest.y : 0.0, (b.z != 0.0) ? rest.z : 0.0);
}

void vector_wrap(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = vec3(wrapped(a.x, b.x, c.x), wrapped(a.y, b.y, c.y), wrapped(a.z, b.z, c.z));
}

void vector_snap(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = floor(vector_divided(a, b)) * b;
}

void vector_sine(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = sin(a);
}

void vector_cosine(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = cos(a);
}

void vector_tangent(vec3 a, vec3 b, vec3 c, float scale, out vec3 result)
{
  result = tan(a);
}

void vector_dot_product(vec3 a, vec3 b, out float result)
{
  result = dot(a, b);
}

void vector_distance(vec3 a, vec3 b, out float result)
{
  result = distance(a, b);
}

void vector_length(vec3 a, vec3 b, out float result)
{
  result = length(a);
}
