// Colour ramps. The stops stand in a table: for each a row with its colour and a row with its position (x),
// in rising order. `first` is the row where they begin, `rows` their number.
#include "material/values.glsl"

vec4 color_ramp_stop(int first, int stop)
{
  return material_row(first, 2 * stop);
}

float color_ramp_position(int first, int stop)
{
  return material_row(first, 2 * stop + 1).x;
}

// Index of the last stop at or before `position` (0 if there is none) and how far it is on the way to the next.
void color_ramp_locate(float position, int first, int rows, out int stop, out float share)
{
  int last = rows / 2 - 1;
  stop = 0;
  for (int i = 1; i <= last; i++) {
    if (color_ramp_position(first, i) <= position) {
      stop = i;
    }
  }
  share = 0.0;
  if (stop < last) {
    float from = color_ramp_position(first, stop);
    share = clamp((position - from) / max(color_ramp_position(first, stop + 1) - from, 1e-6), 0.0, 1.0);
  }
}

vec4 color_ramp_blend(int first, int rows, int stop, float share)
{
  int next = min(stop + 1, rows / 2 - 1);
  return mix(color_ramp_stop(first, stop), color_ramp_stop(first, next), share);
}

void color_ramp_linear(float position, int first, int rows, out vec3 color, out float alpha)
{
  int stop;
  float share;
  color_ramp_locate(position, first, rows, stop, share);
  vec4 blended = color_ramp_blend(first, rows, stop, share);
  color = blended.rgb;
  alpha = blended.a;
}

void color_ramp_ease(float position, int first, int rows, out vec3 color, out float alpha)
{
  int stop;
  float share;
  color_ramp_locate(position, first, rows, stop, share);
  vec4 blended = color_ramp_blend(first, rows, stop, share * share * (3.0 - 2.0 * share));
  color = blended.rgb;
  alpha = blended.a;
}

void color_ramp_constant(float position, int first, int rows, out vec3 color, out float alpha)
{
  int stop;
  float share;
  color_ramp_locate(position, first, rows, stop, share);
  vec4 held = color_ramp_stop(first, stop);
  color = held.rgb;
  alpha = held.a;
}
