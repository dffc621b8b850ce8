// Nodes that convert and mix numbers, vectors and colours.

#include "lib/color.glsl"
#include "material/color_models.glsl"

void mix_float(float t, float a, float b, out float result)
{
  result = mix(a, b, t);
}

void mix_vector(float t, vec3 a, vec3 b, out vec3 result)
{
  result = mix(a, b, t);
}

void mix_vector_non_uniform(vec3 t, vec3 a, vec3 b, out vec3 result)
{
  result = mix(a, b, t);
}

void invert(float t, vec3 color, out vec3 result)
{
  result = mix(color, vec3(1.0) - color, t);
}

void separate_rgb(vec3 color, out float first, out float second, out float third)
{
  first = color.x;
  second = color.y;
  third = color.z;
}

void separate_hsv(vec3 color, out float first, out float second, out float third)
{
  separate_rgb(rgb_to_hsv(color), first, second, third);
}

void separate_hsl(vec3 color, out float first, out float second, out float third)
{
  separate_rgb(rgb_to_hsl(color), first, second, third);
}

void combine_rgb(float first, float second, float third, out vec3 color)
{
  color = vec3(first, second, third);
}

// Hues are not wrapped here: as in Cycles all that lie outside have the colours of the last sixth.
void combine_hsv(float first, float second, float third, out vec3 color)
{
  color = hsv_to_rgb(vec3(first, second, third));
  if (first >= 1.0 || first < 0.0) {
    float part = first * 6.0 - floor(first * 6.0);
    color = third * vec3(1.0, 1.0 - second, 1.0 - second * part);
  }
}

void combine_hsl(float first, float second, float third, out vec3 color)
{
  color = hsl_to_rgb(vec3(first, second, third));
}

void clamp_minmax(float value, float low, float high, out float result)
{
  result = min(max(value, low), high);
}

void clamp_range(float value, float low, float high, out float result)
{
  result = min(max(value, min(low, high)), max(low, high));
}

void rgb_to_bw(vec3 color, out float result)
{
  result = color_luminance(color);
}

void gamma_color(vec3 color, float gamma, out vec3 result)
{
  result = vec3((color.x > 0.0) ? pow(color.x, gamma) : color.x, (color.y > 0.0) ? pow(color.y, gamma) : color.y,
                (color.z > 0.0) ? pow(color.z, gamma) : color.z);
}

void bright_contrast(vec3 color, float brightness, float contrast, out vec3 result)
{
  result = max((1.0 + contrast) * color + vec3(brightness - 0.5 * contrast), vec3(0.0));
}

void convert_float(float value, out float result)
{
  result = value;
}

void convert_vector(vec3 value, out vec3 result)
{
  result = value;
}

void hue_saturation(float hue, float saturation, float value, float share, vec3 color, out vec3 result)
{
  vec3 hsv = rgb_to_hsv(color);
  hsv.x = hsv.x + hue + 0.5 - floor(hsv.x + hue + 0.5);
  hsv.y = clamp(hsv.y * saturation, 0.0, 1.0);
  hsv.z *= value;
  result = max(mix(color, hsv_to_rgb(hsv), share), vec3(0.0));
}
