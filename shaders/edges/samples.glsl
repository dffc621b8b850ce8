// Points of a light as offsets from its centre (at infinity: from the direction towards it), from a pattern's texels.
//
// `shape`: 0 a place along the light's half axes; 1, 2 a point of the unit disc, for a disc that faces the receiver: as large
// as the round lamp, or as a sphere's outline is seen; 3, 4 an offset in the unit ball whose projection is that point; 5 the
// offset itself. Discs of a sphere have the radius of the cone around it.
#define IN_PLANE 0
#define FACING_SPHERE 2
#define BALL_DISC 3
#define BALL_SPHERE 4
#define AS_THEY_ARE 5

struct LightFrame {
  vec3 u;
  vec3 v;
  vec3 axis;    // from the receiver to the centre, unit
  float away;   // distance of the centre
  float radius; // of the disc
  float spread; // 1 - cosine of the cone around a sphere
};

LightFrame light_frame(vec3 to_centre)
{
  LightFrame f;
  f.away = length(to_centre);
  f.axis = to_centre / max(f.away, 1e-30);
  f.radius = edge_light.size.y;
  float sine = min(f.radius / max(f.away, 1e-30), 0.999);
  float cosine = sqrt(1.0 - sine * sine);
  f.spread = sine * sine / (1.0 + cosine);
  if (edge_light.shape == FACING_SPHERE || edge_light.shape == BALL_SPHERE) {
    f.radius /= cosine;
  }
  orthonormal_basis(f.axis, f.u, f.v);
  f.u *= f.radius;
  f.v *= f.radius;
  return f;
}

// Half axes of what holds the points.
void light_axes(LightFrame f, out vec3 half_u, out vec3 half_v)
{
  bool facing = edge_light.shape != IN_PLANE;
  half_u = facing ? f.u : edge_light.half_u.xyz;
  half_v = facing ? f.v : edge_light.half_v.xyz;
}

// Neighbouring pixels take other patterns of points.
int pattern_of(ivec2 pixel)
{
  return ((pixel.x & 3) + 4 * (pixel.y & 3)) % edge_light.pattern_count;
}

// Of a point in space: shapes from BALL_DISC on.
vec3 light_offset(LightFrame f, vec3 t)
{
  if (edge_light.shape == AS_THEY_ARE) {
    return t;
  }
  vec3 across = t - f.axis * dot(t, f.axis);
  if (edge_light.shape == BALL_SPHERE) {
    // light_sample (light/sources.glsl) draws the cone's solid angle evenly: where that direction meets the disc.
    float squared = min(dot(across, across), 1.0);
    float cosine = 1.0 - squared * f.spread;
    float tangent = sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine;
    return safe_normalize(across) * (tangent * f.away);
  }
  return across * f.radius;
}
