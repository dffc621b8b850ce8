// The prism over a triangle: what `shell_corners` holds of it, and where in it a place is.
//
// Texel 0: lowest and highest level of the relief, m; most steps; search (see relief.glsl). Texel 1: refinements; whether
// steps are safe; the steepest slope. Then by triangle and corner, in object space: place, normal, attributes.
#include "lib/instance.glsl"

vec4 shell_texel(int index)
{
  return shell_corners_fetch(ivec2(index & 2047, index >> 11));
}

// A place is (b1, b2, h): C + b1 e1 + b2 e2 + h (n + b1 n1 + b2 n2), with h in metres.
struct Shell {
  vec3 origin;
  vec3 e1;
  vec3 e2;
  vec3 n;   // unit normal at the first corner, and what it changes to the second and third
  vec3 n1;
  vec3 n2;
};

Shell shell_read(Instance instance, int base, int stride)
{
  int corner = stride / 3;
  Shell s;
  s.origin = instance_position(instance, shell_texel(base).xyz);
  s.e1 = instance_position(instance, shell_texel(base + corner).xyz) - s.origin;
  s.e2 = instance_position(instance, shell_texel(base + 2 * corner).xyz) - s.origin;
  s.n = normalize(instance_normal(instance, shell_texel(base + 1).xyz));
  s.n1 = normalize(instance_normal(instance, shell_texel(base + corner + 1).xyz)) - s.n;
  s.n2 = normalize(instance_normal(instance, shell_texel(base + 2 * corner + 1).xyz)) - s.n;
  return s;
}

vec3 shell_normal(Shell s, vec2 b)
{
  return s.n + b.x * s.n1 + b.y * s.n2;
}

// What a step in space is in (b1, b2, h) at a place of the prism.
vec3 shell_step(Shell s, vec3 at, vec3 step_m)
{
  vec3 a = s.e1 + at.z * s.n1;
  vec3 b = s.e2 + at.z * s.n2;
  vec3 c = shell_normal(s, at.xy);
  vec3 across = cross(b, c);
  float volume = dot(a, across);
  // A triangle without area has no inside.
  return (abs(volume) > 1e-37)
             ? vec3(dot(step_m, across), dot(step_m, cross(c, a)), dot(step_m, cross(a, b))) / volume : vec3(0.0);
}

// A step of Newton's method: exact where normals are parallel, as on a plane.
vec3 shell_nearer(Shell s, vec3 place, vec3 guess)
{
  vec3 reached = s.origin + guess.x * s.e1 + guess.y * s.e2 + guess.z * shell_normal(s, guess.xy);
  return guess + shell_step(s, guess, place - reached);
}

vec3 shell_place(Shell s, vec3 place, vec3 guess)
{
  return shell_nearer(s, place, shell_nearer(s, place, guess));
}

// How far outside of the prism over its triangle a place is, in shares of the triangle; 0 inside.
float shell_outside(vec2 b)
{
  return max(max(-b.x, -b.y), max(b.x + b.y - 1.0, 0.0));
}
