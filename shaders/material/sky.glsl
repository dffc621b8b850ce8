// A clear sky by direction, from the table that addon/materials/sky.py makes; the compiler generates each table's own
// lookup. Sun: bottom and top of the disc have their own colour, its edge is darker.
#include "lib/math.glsl"

// Place in the table, 0..1: azimuth from the sun's, and elevation, finer towards the horizon.
vec2 sky_place(vec3 direction, float sun_rotation)
{
  float elevation = asin(clamp(direction.z, -1.0, 1.0));
  float azimuth = (direction.x == 0.0 && direction.y == 0.0) ? 0.0 : atan(direction.y, direction.x);
  float row = sqrt(abs(elevation) * 2.0 / PI);
  return vec2(fract((azimuth + sun_rotation) / (2.0 * PI) - 0.25), ((elevation < 0.0) ? -row : row) * 0.5 + 0.5);
}

// Columns and rows of the lower (xy) and the upper (zw) neighbour: around the sky, and up to the zenith.
ivec4 sky_texels(ivec2 lower, ivec2 size)
{
  return ivec4((lower.x + size.x) % size.x, clamp(lower.y, 0, size.y - 1), (lower.x + 1) % size.x,
               clamp(lower.y + 1, 0, size.y - 1));
}

// `turn`: rotation, half angle and elevation of the sun. `horizon`: elevation above which the disc is seen.
vec3 sky_sun(vec3 direction, vec3 turn, vec3 low, vec3 high, vec3 to_sun, float horizon)
{
  float elevation = asin(clamp(direction.z, -1.0, 1.0));
  // By chords: the cosine of so small an angle has no digits left.
  float angle = 2.0 * asin(clamp(0.5 * length(direction - to_sun), 0.0, 1.0));
  if (turn.y <= 0.0 || angle >= turn.y || elevation <= horizon) {
    return vec3(0.0);
  }
  float across = angle / turn.y;
  float edge = 1.0 - 0.6 * (1.0 - sqrt(max(1.0 - across * across, 0.0)));
  return mix(low, high, (elevation - turn.z) / (2.0 * turn.y) + 0.5) * edge;
}
