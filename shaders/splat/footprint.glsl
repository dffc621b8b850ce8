// The biweight kernel over the ellipse of a record's half axes, per area of its plane: it integrates to one.

// `offset`, the way from the record's centre, in half axes.
vec2 footprint_place(vec3 first, vec3 second, vec3 offset)
{
  return vec2(dot(offset, first) / max(dot(first, first), 1e-30), dot(offset, second) / max(dot(second, second), 1e-30));
}

float footprint_kernel(vec2 place)
{
  float inside = max(1.0 - dot(place, place), 0.0);
  return inside * inside;
}

// In the middle, per area.
float footprint_peak(vec3 first, vec3 second)
{
  float area = 3.14159265 * sqrt(max(dot(first, first), 1e-30) * max(dot(second, second), 1e-30));
  return 3.0 / area;
}
