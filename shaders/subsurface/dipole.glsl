// The dipole's diffuse reflectance (Jensen et al. 2001; kernels/diffusion.py has it in closed form, too):
//
//   R_d(r) = alpha'/(4 pi) sum over z of  z (sigma_tr + 1/d) exp(-sigma_tr d) / d^2,   d = sqrt(r^2 + z^2),
//
// z = 1/sigma_t' of the real source and slope times that of the virtual one. The albedo inverts its total.
struct Dipole {
  vec3 real;       // depth of the real source, m
  vec3 transport;  // sigma_tr, 1/m
  float slope;     // height of the virtual source over that depth: 1 + 4 A / 3
};

#define LEAST_DECAY 0.0173  // of sigma_tr z: absorption is 1e-4 of extinction at least, so that the range has a bound

float dipole_slope(float ior)
{
  float inside = (ior > 1.0) ? -1.440 / (ior * ior) + 0.710 / ior + 0.668 + 0.0636 * ior : 0.0;
  return 1.0 + 4.0 / 3.0 * (1.0 + inside) / (1.0 - inside);
}

// sigma_tr z of the dipole whose total is `albedo`.
float dipole_decay(float albedo, float slope)
{
  float low = 0.0;
  float high = 1.0;
  for (int i = 0; i < 20; i++) {
    float middle = 0.5 * (low + high);
    float s = sqrt(3.0 * (1.0 - middle));
    bool below = 0.5 * middle * (exp(-s) + exp(-slope * s)) < albedo;
    low = below ? middle : low;
    high = below ? high : middle;
  }
  return max(sqrt(3.0 * (1.0 - 0.5 * (low + high))), LEAST_DECAY);
}

// Of a material's profile: `length_m` is the walk's mean free path, or Burley's d, whose diffuse mean free path 1/sigma_tr is
// (3.5 + 100 (albedo - .33)^4) d (Christensen and Burley 2015, eq. 8).
Dipole dipole_of(bool burley, vec3 length_m, vec3 color, float ior)
{
  Dipole made;
  made.slope = dipole_slope(ior);
  vec3 decay = vec3(dipole_decay(color.x, made.slope), dipole_decay(color.y, made.slope), dipole_decay(color.z, made.slope));
  vec3 apart = color - vec3(0.33);
  vec3 stretched = length_m * (vec3(3.5) + 100.0 * apart * apart * apart * apart);
  made.real = max(burley ? decay * stretched : length_m, vec3(1e-12));
  made.transport = decay / made.real;
  return made;
}

vec3 dipole_term(vec3 z, vec3 transport, float r)
{
  vec3 d = sqrt(vec3(r * r) + z * z);
  return z * (transport + vec3(1.0) / d) * exp(-transport * d) / (d * d);
}

// R_d, 1/m2.
vec3 dipole_at(Dipole p, float r)
{
  vec3 decay = p.transport * p.real;
  vec3 albedo = vec3(1.0) - decay * decay / 3.0;
  return albedo / (4.0 * PI) * (dipole_term(p.real, p.transport, r) + dipole_term(p.slope * p.real, p.transport, r));
}

// Share of the light of a channel that leaves beyond a radius.
float dipole_beyond(float z, float slope, float transport, float radius)
{
  float first = sqrt(radius * radius + z * z);
  float second = sqrt(radius * radius + slope * slope * z * z);
  float rest = z / first * exp(-transport * first) + slope * z / second * exp(-transport * second);
  return rest / (exp(-transport * z) + exp(-transport * slope * z));
}

// Radius beyond which less than 1 % of every channel leaves, m.
float dipole_range(Dipole p)
{
  float range = 0.0;
  for (int channel = 0; channel < 3; channel++) {
    float low = 0.0;
    float high = 6.0 / p.transport[channel];
    for (int i = 0; i < 16; i++) {
      float middle = 0.5 * (low + high);
      bool far = dipole_beyond(p.real[channel], p.slope, p.transport[channel], middle) < 0.01;
      low = far ? low : middle;
      high = far ? middle : high;
    }
    range = max(range, high);
  }
  return range;
}
