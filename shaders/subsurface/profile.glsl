// Profiles of subsurface scattering: a mixture of three lobes per channel (addon/kernels/diffusion.py)
//
//   R(r) = sum over lobes of  share exp(-r / scale) / (2 pi scale r),   integral over the plane 1
//
// Christensen-Burley's (2015) has the shares 1/4, 3/4 and the scales d, 3d; the random walk's stand in `walk_lobes`.
#define PROFILE_BURLEY 0
#define PROFILE_WALK 1

struct Profile {
  vec3 share1;
  vec3 share2;
  vec3 share3;
  vec3 scale1;  // m, at least LEAST_SCALE
  vec3 scale2;
  vec3 scale3;
};

#define LEAST_SCALE 1e-12

// sqrt(1 - single-scattering albedo) of the isotropic walk that returns this albedo of light from all sides (d'Eon, "A
// Hitchhiker's Guide to Multiple Scattering", eq. 53.7).
vec3 walk_absorption(vec3 albedo)
{
  vec3 a = clamp(albedo, vec3(0.0), vec3(1.0));
  vec3 root = sqrt(vec3(9.59217) + 41.6808 * a + 17.7126 * a * a);
  return clamp(4.20863 * a - root + vec3(4.09712), vec3(0.0), vec3(1.0));
}

// Of light that entered at this cosine inside, the share that comes out again: 1 - g H(cosine), H after Hapke (2002), with
// what that is too bright by (1 %) fitted to the solution of Chandrasekhar's equation.
vec3 walk_returned(vec3 absorption, float cosine)
{
  vec3 r0 = (vec3(1.0) - absorption) / (vec3(1.0) + absorption);
  float series = log((1.0 + cosine) / max(cosine, 1e-6));
  vec3 inner = r0 + (vec3(0.5) - r0 * cosine) * series;
  vec3 h = vec3(1.0) / (vec3(1.0) - (vec3(1.0) - absorption * absorption) * cosine * inner);
  vec3 correction = vec3(1.0) - absorption * (vec3(0.033) - 0.021 * absorption);
  return max(vec3(1.0) - absorption * h, vec3(0.0)) * correction;
}

Profile burley_profile(vec3 d)
{
  Profile p;
  p.share1 = vec3(0.25);
  p.share2 = vec3(0.75);
  p.share3 = vec3(0.0);
  p.scale1 = d;
  p.scale2 = 3.0 * d;
  p.scale3 = d;
  return p;
}

#ifdef WALK_LOBES
void walk_channel(float absorption, out vec3 share, out vec3 scale)
{
  float last = float(walk_lobes_size().x - 1);
  float at = sqrt(clamp(absorption, 0.0, 1.0)) * last;
  int i = int(min(floor(at), last - 1.0));
  float part = at - float(i);
  vec4 first = mix(walk_lobes_fetch(ivec2(i, 0)), walk_lobes_fetch(ivec2(i + 1, 0)), part);
  float third = mix(walk_lobes_fetch(ivec2(i, 1)).x, walk_lobes_fetch(ivec2(i + 1, 1)).x, part);
  share = vec3(first.xy, 1.0 - first.x - first.y);
  scale = vec3(first.zw, third);
}

// `length_m`: Burley's d, or the walk's mean free path, per channel.
Profile profile_of(int kind, vec3 length_m, vec3 albedo)
{
  Profile p = burley_profile(length_m);
  if (kind == PROFILE_WALK) {
    vec3 absorption = walk_absorption(albedo);
    vec3 share;
    vec3 scale;
    walk_channel(absorption.x, share, scale);
    p.share1.x = share.x;
    p.share2.x = share.y;
    p.share3.x = share.z;
    p.scale1.x = scale.x * length_m.x;
    p.scale2.x = scale.y * length_m.x;
    p.scale3.x = scale.z * length_m.x;
    walk_channel(absorption.y, share, scale);
    p.share1.y = share.x;
    p.share2.y = share.y;
    p.share3.y = share.z;
    p.scale1.y = scale.x * length_m.y;
    p.scale2.y = scale.y * length_m.y;
    p.scale3.y = scale.z * length_m.y;
    walk_channel(absorption.z, share, scale);
    p.share1.z = share.x;
    p.share2.z = share.y;
    p.share3.z = share.z;
    p.scale1.z = scale.x * length_m.z;
    p.scale2.z = scale.y * length_m.z;
    p.scale3.z = scale.z * length_m.z;
  }
  p.scale1 = max(p.scale1, vec3(LEAST_SCALE));
  p.scale2 = max(p.scale2, vec3(LEAST_SCALE));
  p.scale3 = max(p.scale3, vec3(LEAST_SCALE));
  return p;
}
#endif

// 2 pi r R(r), per m: finite at r = 0.
vec3 profile_radial(Profile p, float r)
{
  return p.share1 / p.scale1 * exp(-r / p.scale1) + p.share2 / p.scale2 * exp(-r / p.scale2)
         + p.share3 / p.scale3 * exp(-r / p.scale3);
}

// How far the profile reaches, m: beyond lies less than 0.25 % of its widest lobe.
#define REACH 6.0
float profile_reach(Profile p)
{
  vec3 widest = max(max(p.scale1, p.scale2), p.scale3 * step(vec3(1e-6), p.share3));
  return REACH * max(max(widest.x, widest.y), widest.z);
}

// The part of the profile that is taken from pixels nearby: smooth, 1 at the middle, 0 from `range` on.
float near_window(float r, float range)
{
  float u = clamp(r / range, 0.0, 1.0);
  float rest = 1.0 - u * u;
  return rest * rest;
}

// Integral over t = 0..a of (1 - (t / a)^2)^2 exp(-t): what of a lobe lies in the window, a = range / scale.
float lobe_near(float a)
{
  a = min(a, 1e9);
  if (a < 1.0) {  // the series in a of the moments of the window
    return a * (8.0 / 15.0 - a * (1.0 / 6.0 - a * (4.0 / 105.0 - a * (1.0 / 144.0 - a * (1.0 / 945.0
           - a * (1.0 / 7200.0 - a / 62370.0))))));
  }
  float m = min(a, 80.0);  // beyond, nothing is left of the exponential, and powers of a leave float32
  float e = exp(-m);
  float b = 1.0 / (a * a);
  float second = 2.0 - e * (m * m + 2.0 * m + 2.0);
  float fourth = 24.0 - e * (m * m * m * m + 4.0 * m * m * m + 12.0 * m * m + 24.0 * m + 24.0);
  return 1.0 - e - 2.0 * b * second + b * b * fourth;
}

vec3 lobes_near(vec3 share, vec3 scale, float range)
{
  return share * vec3(lobe_near(range / scale.x), lobe_near(range / scale.y), lobe_near(range / scale.z));
}

vec3 profile_near(Profile p, float range)
{
  return lobes_near(p.share1, p.scale1, range) + lobes_near(p.share2, p.scale2, range)
         + lobes_near(p.share3, p.scale3, range);
}
