// Between a square and the hemisphere, in equal shares of cosine-weighted solid angle: the square to the disc by Shirley and
// Chiu's concentric map (1997), the disc up to the hemisphere above it (Nusselt). Continuous, so that what lies close on the
// hemisphere lies close on the square: no step on the disc is more than STRETCH times as long on the square.
#define STRETCH 1.62  // sqrt(1 + 1 + (4 / PI)^2): of radius and angle, at most 45 degrees from an axis

vec2 disc_of_square(vec2 square)
{
  bool wide = abs(square.x) >= abs(square.y);
  float radius = wide ? square.x : square.y;
  float along = (wide ? square.y : square.x) / ((radius == 0.0) ? 1.0 : radius);
  // Sine and cosine of 45 degrees at most, to 4e-7: this is where most of a micro-buffer's time goes.
  float turn = 0.25 * PI * along;
  float t = turn * turn;
  float sine = turn * (1.0 - t * (1.0 / 6.0 - t * (1.0 / 120.0 - t * (1.0 / 5040.0))));
  float cosine = 1.0 - t * (0.5 - t * (1.0 / 24.0 - t * (1.0 / 720.0 - t * (1.0 / 40320.0))));
  return radius * (wide ? vec2(cosine, sine) : vec2(sine, cosine));
}

vec2 square_of_disc(vec2 disc)
{
  bool wide = abs(disc.x) >= abs(disc.y);
  float larger = wide ? disc.x : disc.y;
  float along = atan((wide ? disc.y : disc.x) / ((larger == 0.0) ? 1.0 : larger)) * (4.0 / PI);
  float radius = (larger < 0.0) ? -length(disc) : length(disc);
  return wide ? vec2(radius, along * radius) : vec2(along * radius, radius);
}

// Half the sides of a box on the square, about the place of `disc`, that holds all within `chord` of it on the disc. Along
// the axis of its quarter the square is as long as the disc; across it sqrt((4 / PI)^2 + the angle's share squared) times.
vec2 square_reach(vec2 disc, float chord)
{
  bool wide = abs(disc.x) >= abs(disc.y);
  float larger = max(abs(disc.x), abs(disc.y));
  float smaller = min(abs(disc.x), abs(disc.y));
  if (larger - smaller < 1.5 * chord) {  // the box may reach into another quarter
    return vec2(STRETCH * chord);
  }
  float along = min((4.0 / PI) * (smaller + chord) / (larger - chord), 1.0);  // as large as any angle's share there
  float across = chord * sqrt(1.6212 + along * along);
  return wide ? vec2(chord, across) : vec2(across, chord);
}
