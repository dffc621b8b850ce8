// Triangles that pass light in places ("cards"): records of CARD_TEXELS texels (lighting/textured_volumes.py), and the test
// whether one can hide a part of a light from a place at all.
#define CARD_TEXELS 5

// Whether a ball of radius `rho` around `to_ball` meets the cone from a receiver to a light's ball of radius `r`, both
// relative to the receiver. Of receivers in a ball of radius x: rho + x and r - x.
bool cone_meets_ball(vec3 to_ball, float rho, vec3 to_centre, float r)
{
  if (light_at_infinity()) {
    float along = dot(to_ball, to_centre);
    float across = length(to_ball - along * to_centre);
    float sine = min(edge_light.size.x, 0.999);
    return along > -rho && across * sqrt(1.0 - sine * sine) - along * sine <= rho;
  }
  float quadratic = dot(to_centre, to_centre) - r * r;
  if (quadratic <= 0.0) {
    return true;
  }
  float linear = dot(to_ball, to_centre) + rho * r;
  float t = clamp(linear / quadratic, 0.0, 1.0);
  return quadratic * t * t - 2.0 * linear * t + dot(to_ball, to_ball) - rho * rho <= 0.0;
}
