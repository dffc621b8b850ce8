// Blend modes of colours, one function per mode.
// `a` is the lower layer, `b` the upper one, `t` how much of the upper one shows.

#include "material/color_models.glsl"

float overlay_channel(float t, float a, float b)
{
  return (a < 0.5) ? a * (1.0 - t + 2.0 * t * b) : 1.0 - (1.0 - t + 2.0 * t * (1.0 - b)) * (1.0 - a);
}

float dodge_channel(float t, float a, float b)
{
  if (a == 0.0) {
    return 0.0;
  }
  float rest = 1.0 - t * b;
  return (rest <= 0.0) ? 1.0 : min(a / rest, 1.0);
}

float burn_channel(float t, float a, float b)
{
  float rest = 1.0 - t + t * b;
  return (rest <= 0.0) ? 0.0 : clamp(1.0 - (1.0 - a) / rest, 0.0, 1.0);
}

float divide_channel(float t, float a, float b)
{
  return (b != 0.0) ? (1.0 - t) * a + t * a / b : a;
}

void blend_mix(float t, vec3 a, vec3 b, out vec3 result)
{
  result = mix(a, b, t);
}

void blend_add(float t, vec3 a, vec3 b, out vec3 result)
{
  result = a + t * b;
}

void blend_multiply(float t, vec3 a, vec3 b, out vec3 result)
{
  result = mix(a, a * b, t);
}

void blend_subtract(float t, vec3 a, vec3 b, out vec3 result)
{
  result = a - t * b;
}

void blend_screen(float t, vec3 a, vec3 b, out vec3 result)
{
  result = vec3(1.0) - (vec3(1.0 - t) + t * (vec3(1.0) - b)) * (vec3(1.0) - a);
}

void blend_difference(float t, vec3 a, vec3 b, out vec3 result)
{
  result = mix(a, abs(a - b), t);
}

void blend_exclusion(float t, vec3 a, vec3 b, out vec3 result)
{
  result = max(mix(a, a + b - 2.0 * a * b, t), vec3(0.0));
}

void blend_darken(float t, vec3 a, vec3 b, out vec3 result)
{
  result = mix(a, min(a, b), t);
}

void blend_lighten(float t, vec3 a, vec3 b, out vec3 result)
{
  result = mix(a, max(a, b), t);
}

void blend_linear_light(float t, vec3 a, vec3 b, out vec3 result)
{
  result = a + t * (2.0 * b - vec3(1.0));
}

void blend_soft_light(float t, vec3 a, vec3 b, out vec3 result)
{
  result = (1.0 - t) * a + t * ((vec3(1.0) - a) * b * a + a * (vec3(1.0) - (vec3(1.0) - b) * (vec3(1.0) - a)));
}

void blend_overlay(float t, vec3 a, vec3 b, out vec3 result)
{
  result = vec3(overlay_channel(t, a.x, b.x), overlay_channel(t, a.y, b.y), overlay_channel(t, a.z, b.z));
}

void blend_dodge(float t, vec3 a, vec3 b, out vec3 result)
{
  result = vec3(dodge_channel(t, a.x, b.x), dodge_channel(t, a.y, b.y), dodge_channel(t, a.z, b.z));
}

void blend_burn(float t, vec3 a, vec3 b, out vec3 result)
{
  result = vec3(burn_channel(t, a.x, b.x), burn_channel(t, a.y, b.y), burn_channel(t, a.z, b.z));
}

void blend_divide(float t, vec3 a, vec3 b, out vec3 result)
{
  result = vec3(divide_channel(t, a.x, b.x), divide_channel(t, a.y, b.y), divide_channel(t, a.z, b.z));
}

void blend_hue(float t, vec3 a, vec3 b, out vec3 result)
{
  vec3 upper = rgb_to_hsv(b);
  vec3 lower = rgb_to_hsv(a);
  result = (upper.y != 0.0) ? mix(a, hsv_to_rgb(vec3(upper.x, lower.y, lower.z)), t) : a;
}

void blend_saturation(float t, vec3 a, vec3 b, out vec3 result)
{
  vec3 lower = rgb_to_hsv(a);
  result = (lower.y != 0.0) ? hsv_to_rgb(vec3(lower.x, mix(lower.y, rgb_to_hsv(b).y, t), lower.z)) : a;
}

void blend_value(float t, vec3 a, vec3 b, out vec3 result)
{
  vec3 lower = rgb_to_hsv(a);
  result = hsv_to_rgb(vec3(lower.x, lower.y, mix(lower.z, rgb_to_hsv(b).z, t)));
}

void blend_color(float t, vec3 a, vec3 b, out vec3 result)
{
  vec3 upper = rgb_to_hsv(b);
  result = (upper.y != 0.0) ? mix(a, hsv_to_rgb(vec3(upper.x, upper.y, rgb_to_hsv(a).z)), t) : a;
}
