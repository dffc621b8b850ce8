// The part of a rectangular light that lies beyond a projected edge, in closed form, for one quarter of the light.
//
// The light is the square [-1, 1]^2; a quarter is mirrored to [0, 1]^2 and measured with its own area as the unit. Points
// are homogeneous, (x, y) / z, until all clips are done; z is 0 at the receiver's height and 1 at the light.

bool clip_edge(inout vec3 a, inout vec3 b, float at_a, float at_b)
{
  if (at_a < 0.0 && at_b < 0.0) {
    return false;
  }
  if (at_a < 0.0) {
    a = mix(a, b, at_a / (at_a - at_b));
  }
  else if (at_b < 0.0) {
    b = mix(b, a, at_b / (at_b - at_a));
  }
  return true;
}

// The edge within the quarter; false where it misses it.
bool clip_to_quarter(inout vec3 a, inout vec3 b, vec2 mirror)
{
  a.xy *= mirror;
  b.xy *= mirror;
  if (!clip_edge(a, b, a.x, b.x)) {
    return false;
  }
  if (!clip_edge(a, b, a.y, b.y)) {
    return false;
  }
  if (!clip_edge(a, b, a.z - a.x, b.z - b.x)) {
    return false;
  }
  return clip_edge(a, b, a.z - a.y, b.z - b.y);
}

// Area swept along the quarter's border, seen from the corner at the light's centre, up to the ray through q.
float swept_area(vec2 q)
{
  return (q.x >= q.y) ? 0.5 * q.y / max(q.x, 1e-20) : 1.0 - 0.5 * q.x / q.y;
}

// Length of that border.
float swept_border(vec2 q)
{
  return (q.x >= q.y) ? q.y / max(q.x, 1e-20) : 2.0 - q.x / q.y;
}

// Area on the far side of an edge between the rays through its ends.
float area_beyond(vec2 a, vec2 b)
{
  return max(abs(swept_area(a) - swept_area(b)) - 0.5 * abs(a.x * b.y - a.y * b.x), 0.0);
}

// Upper corner of the box around that region; the lower one is min(a, b).
vec2 far_corner(vec2 a, vec2 b)
{
  vec2 from = a / max(a.x, a.y);
  vec2 to = b / max(b.x, b.y);
  bool around_corner = (a.x >= a.y) != (b.x >= b.y);
  return around_corner ? vec2(1.0) : max(from, to);
}
