// Of irradiance at a point: the share `t` that comes from one direction d, where the rest comes from all sides alike. `way`: its
// mean direction times its luminance `light`. Even light comes from 2/3 n in the mean, so that with w = way / light
//   w = (1 - t) 2/3 n + t d,  |d| = 1,   of which t is the positive root of  5/9 t^2 - 2 t (v . a) - v^2,  a = 2/3 n, v = w - a.
// xyz: d, w: t; 0 where that direction lies behind the surface or along it.
#define LEAST_COSINE 0.05

vec4 directed_share(vec3 way, float light, vec3 normal)
{
  vec3 even = (2.0 / 3.0) * normal;
  vec3 off = way / max(light, DARK) - even;
  float along = dot(off, even);
  float share = clamp(1.8 * (along + sqrt(along * along + (5.0 / 9.0) * dot(off, off))), 0.0, 1.0);
  vec3 from = (off + share * even) / max(share, 1e-6);
  bool reflects = light > DARK && share > 1e-3 && dot(from, normal) > LEAST_COSINE;
  return reflects ? vec4(from, share) : vec4(normal, 0.0);
}
