// Hue, saturation and value, or lightness, of scene-linear colours; hue counts full turns.

vec3 rgb_to_hsv(vec3 color)
{
  float value = max(max(color.x, color.y), color.z);
  float span = value - min(min(color.x, color.y), color.z);
  if (value == 0.0 || span == 0.0) {
    return vec3(0.0, 0.0, value);
  }
  vec3 c = (vec3(value) - color) / span;
  float hue = (color.x == value) ? c.z - c.y : ((color.y == value) ? 2.0 + c.x - c.z : 4.0 + c.y - c.x);
  hue *= 1.0 / 6.0;
  return vec3(hue - floor(hue), span / value, value);
}

vec3 hue_color(float hue)
{
  return clamp(vec3(abs(hue * 6.0 - 3.0) - 1.0, 2.0 - abs(hue * 6.0 - 2.0), 2.0 - abs(hue * 6.0 - 4.0)), vec3(0.0),
               vec3(1.0));
}

vec3 hsv_to_rgb(vec3 hsv)
{
  return ((hue_color(hsv.x - floor(hsv.x)) - vec3(1.0)) * hsv.y + vec3(1.0)) * hsv.z;
}

vec3 rgb_to_hsl(vec3 color)
{
  float high = max(max(color.x, color.y), color.z);
  float low = min(min(color.x, color.y), color.z);
  float lightness = min(1.0, 0.5 * (high + low));
  float saturation = 0.0;
  if (high != low) {
    saturation = (lightness > 0.5) ? (high - low) / (2.0 - high - low) : (high - low) / (high + low);
  }
  return vec3(rgb_to_hsv(color).x, saturation, lightness);
}

vec3 hsl_to_rgb(vec3 hsl)
{
  float chroma = (1.0 - abs(2.0 * hsl.z - 1.0)) * hsl.y;
  return (hue_color(hsl.x) - vec3(0.5)) * chroma + vec3(hsl.z);
}
