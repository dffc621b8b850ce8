// The biweight kernel over the ellipse of a record's half axes, per area of its plane; integrates to one. `offset` is
// the way from the record's centre.
float footprint_weight(vec3 first, vec3 second, vec3 offset)
{
  float a = max(dot(first, first), 1e-30);
  float b = max(dot(second, second), 1e-30);
  float x = dot(offset, first) / a;
  float y = dot(offset, second) / b;
  float inside = max(1.0 - x * x - y * y, 0.0);
  return inside * inside * 3.0 * inversesqrt(a) * inversesqrt(b) / 3.14159265;
}
