// Math node, one function per operation. Every function is total: where mathematics has no answer (division by
// zero, root of a negative number) the answer is 0, as in Cycles.

float safe_divide(float a, float b)
{
  return (b != 0.0) ? a / b : 0.0;
}

float safe_power(float base, float exponent)
{
  if (exponent == 0.0) {
    return 1.0;
  }
  if (base == 0.0) {
    return 0.0;
  }
  if (base > 0.0) {
    return pow(base, exponent);
  }
  if (exponent != floor(exponent)) {
    return 0.0;
  }
  float odd = exponent - 2.0 * floor(exponent * 0.5);
  float magnitude = pow(-base, exponent);
  return (odd > 0.5) ? -magnitude : magnitude;
}

float safe_logarithm(float a, float b)
{
  if (a <= 0.0 || b <= 0.0) {
    return 0.0;
  }
  return safe_divide(log(a), log(b));
}

float truncated(float a)
{
  return (a < 0.0) ? ceil(a) : floor(a);
}

float floored_modulo(float a, float b)
{
  return (b != 0.0) ? a - floor(a / b) * b : 0.0;
}

float wrapped(float value, float upper, float lower)
{
  float range = upper - lower;
  return (range != 0.0) ? value - range * floor((value - lower) / range) : lower;
}

float ping_pong(float a, float b)
{
  if (b == 0.0) {
    return 0.0;
  }
  float x = (a - b) / (2.0 * b);
  return abs((x - floor(x)) * b * 2.0 - b);
}

float smooth_minimum(float a, float b, float width)
{
  if (width == 0.0) {
    return min(a, b);
  }
  float h = max(width - abs(a - b), 0.0) / width;
  return min(a, b) - h * h * h * width * (1.0 / 6.0);
}

void math_add(float a, float b, float c, out float result)
{
  result = a + b;
}

void math_subtract(float a, float b, float c, out float result)
{
  result = a - b;
}

void math_multiply(float a, float b, float c, out float result)
{
  result = a * b;
}

void math_divide(float a, float b, float c, out float result)
{
  result = safe_divide(a, b);
}

void math_multiply_add(float a, float b, float c, out float result)
{
  result = a * b + c;
}

void math_power(float a, float b, float c, out float result)
{
  result = safe_power(a, b);
}

void math_logarithm(float a, float b, float c, out float result)
{
  result = safe_logarithm(a, b);
}

void math_sqrt(float a, float b, float c, out float result)
{
  result = sqrt(max(a, 0.0));
}

void math_inverse_sqrt(float a, float b, float c, out float result)
{
  result = (a > 0.0) ? inversesqrt(a) : 0.0;
}

void math_absolute(float a, float b, float c, out float result)
{
  result = abs(a);
}

void math_exponent(float a, float b, float c, out float result)
{
  result = exp(a);
}

void math_minimum(float a, float b, float c, out float result)
{
  result = min(a, b);
}

void math_maximum(float a, float b, float c, out float result)
{
  result = max(a, b);
}

void math_less_than(float a, float b, float c, out float result)
{
  result = (a < b) ? 1.0 : 0.0;
}

void math_greater_than(float a, float b, float c, out float result)
{
  result = (a > b) ? 1.0 : 0.0;
}

void math_sign(float a, float b, float c, out float result)
{
  result = sign(a);
}

void math_compare(float a, float b, float c, out float result)
{
  result = (a == b || abs(a - b) <= max(c, 1.1920929e-7)) ? 1.0 : 0.0;
}

void math_smooth_min(float a, float b, float c, out float result)
{
  result = smooth_minimum(a, b, c);
}

void math_smooth_max(float a, float b, float c, out float result)
{
  result = -smooth_minimum(-a, -b, c);
}

void math_round(float a, float b, float c, out float result)
{
  result = floor(a + 0.5);
}

void math_floor(float a, float b, float c, out float result)
{
  result = floor(a);
}

void math_ceil(float a, float b, float c, out float result)
{
  result = ceil(a);
}

void math_trunc(float a, float b, float c, out float result)
{
  result = truncated(a);
}

void math_fract(float a, float b, float c, out float result)
{
  result = a - floor(a);
}

void math_modulo(float a, float b, float c, out float result)
{
  result = (b != 0.0) ? a - b * truncated(a / b) : 0.0;
}

void math_floored_modulo(float a, float b, float c, out float result)
{
  result = floored_modulo(a, b);
}

void math_wrap(float a, float b, float c, out float result)
{
  result = wrapped(a, b, c);
}

void math_snap(float a, float b, float c, out float result)
{
  result = floor(safe_divide(a, b)) * b;
}

void math_pingpong(float a, float b, float c, out float result)
{
  result = ping_pong(a, b);
}

void math_sine(float a, float b, float c, out float result)
{
  result = sin(a);
}

void math_cosine(float a, float b, float c, out float result)
{
  result = cos(a);
}

void math_tangent(float a, float b, float c, out float result)
{
  result = tan(a);
}

void math_arcsine(float a, float b, float c, out float result)
{
  result = asin(clamp(a, -1.0, 1.0));
}

void math_arccosine(float a, float b, float c, out float result)
{
  result = acos(clamp(a, -1.0, 1.0));
}

void math_arctangent(float a, float b, float c, out float result)
{
  result = atan(a);
}

void math_arctan2(float a, float b, float c, out float result)
{
  result = (a == 0.0 && b == 0.0) ? 0.0 : atan(a, b);
}

void math_sinh(float a, float b, float c, out float result)
{
  result = 0.5 * (exp(a) - exp(-a));
}

void math_cosh(float a, float b, float c, out float result)
{
  result = 0.5 * (exp(a) + exp(-a));
}

void math_tanh(float a, float b, float c, out float result)
{
  result = 1.0 - 2.0 / (exp(2.0 * a) + 1.0);
}

void math_radians(float a, float b, float c, out float result)
{
  result = a * 0.017453292519943295;
}

void math_degrees(float a, float b, float c, out float result)
{
  result = a * 57.29577951308232;
}
