// Curves, colour ramps and spectra as tables of evenly spaced rows, linear in between.
#include "material/values.glsl"

// `position` counts rows; beyond the ends the table goes on straight or stays as it is.
vec4 table_row(float position, int first, int rows, bool onwards)
{
  float last = float(rows - 1);
  float bounded = clamp(position, 0.0, last);
  int row = min(int(bounded), rows - 2);
  vec4 low = material_row(first, row);
  vec4 high = material_row(first, row + 1);
  return mix(low, high, (onwards ? clamp(position, -3e38, 3e38) : bounded) - float(row));
}

// How far along the table a value is; `start` and `extent` say what it covers.
float table_position(float value, float start, float extent, int rows)
{
  return ((extent != 0.0) ? (value - start) / extent : 0.0) * float(rows - 1);
}

void float_curve(float share, float value, float start, float extent, bool onwards, int first, int rows,
                 out float result)
{
  result = mix(value, table_row(table_position(value, start, extent, rows), first, rows, onwards).x, share);
}

void vector_curves(float share, vec3 value, float start, float extent, bool onwards, int first, int rows,
                   out vec3 result)
{
  vec3 curved = vec3(table_row(table_position(value.x, start, extent, rows), first, rows, onwards).x,
                     table_row(table_position(value.y, start, extent, rows), first, rows, onwards).y,
                     table_row(table_position(value.z, start, extent, rows), first, rows, onwards).z);
  result = mix(value, curved, share);
}

void color_ramp_table(float share, int first, int rows, out vec3 color, out float alpha)
{
  vec4 found = table_row(clamp(share, 0.0, 1.0) * float(rows - 1), first, rows, false);
  color = found.rgb;
  alpha = found.a;
}

// Rows run over the reciprocal of the temperature, `start` and `extent` in 1 / kelvin: colours change evenly with it.
void blackbody_table(float kelvin, float start, float extent, int first, int rows, out vec3 color)
{
  color = table_row(table_position(1.0 / max(kelvin, 1.0), start, extent, rows), first, rows, false).rgb;
}

// Black beyond what the eye sees.
void wavelength_table(float nanometres, float start, float extent, int first, int rows, out vec3 color)
{
  float position = table_position(nanometres, start, extent, rows);
  bool seen = position >= 0.0 && position < float(rows - 1);
  color = seen ? max(table_row(position, first, rows, false).rgb, vec3(0.0)) : vec3(0.0);
}
