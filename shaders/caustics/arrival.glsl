// Where a photon came from and what takes it, as one number that a float32 holds exactly: 22 bits of direction, to about a
// tenth of a degree, and whether glossy lobes take it, too (caustics/gloss.glsl); below 0 where those alone do. Not 0.
#define ARRIVAL_STEPS 2047.0

float arrival_encode(vec3 direction, bool to_gloss, bool to_diffuse)
{
  vec2 steps = floor((octahedral_encode(direction) * 0.5 + 0.5) * ARRIVAL_STEPS + 0.5);
  float code = 1.0 + 2.0 * (steps.x + (ARRIVAL_STEPS + 1.0) * steps.y) + (to_gloss ? 1.0 : 0.0);
  return to_diffuse ? code : -code;
}

// Towards where it came from.
vec3 arrival_direction(float arrival)
{
  float code = floor((abs(arrival) - 1.0) / 2.0);
  float y = floor(code / (ARRIVAL_STEPS + 1.0));
  return octahedral_decode(vec2(code - (ARRIVAL_STEPS + 1.0) * y, y) * (2.0 / ARRIVAL_STEPS) - 1.0);
}

bool arrives_on_gloss(float arrival)
{
  return mod(abs(arrival) - 1.0, 2.0) > 0.5;
}

bool arrives_on_diffuse(float arrival)
{
  return arrival > 0.0;
}
