// Rays through the pixels of a micro-buffer: equal shares of the cosine-weighted hemisphere above a place, or, with GLOSSY, of
// what a lobe of microfacets reflects to the viewer.
#include "micro/warp.glsl"

struct MicroFrame {
  vec3 place;
  vec3 tangent;
  vec3 bitangent;
  vec3 normal;
  vec3 plane;  // normal of the triangle: nothing is seen below it
  vec2 shift;  // of a pixel's middle, 0..1
#ifdef GLOSSY
  Lobe lobe;
  vec3 axis;   // of the cone that holds all rays
  float angle; // and half its angle, radians
#endif
};

// Where the ray of a pixel goes. Of a lobe: and what light from there counts.
vec3 micro_ray(MicroFrame f, ivec2 pixel, out vec3 weight)
{
#ifdef GLOSSY
  return lobe_sample(f.lobe, (vec2(pixel) + f.shift) / float(micro_side), weight);
#else
  weight = vec3(1.0);
  vec2 disc = disc_of_square((vec2(pixel) + f.shift) * (2.0 / float(micro_side)) - 1.0);
  return disc.x * f.tangent + disc.y * f.bitangent + sqrt(max(1.0 - dot(disc, disc), 0.0)) * f.normal;
#endif
}

MicroFrame micro_frame(vec3 place, vec3 normal, vec3 plane, vec3 turn_and_shift)
{
  MicroFrame f;
  f.place = place;
  f.normal = normal;
  f.plane = plane;
  vec3 first;
  vec3 second;
  orthonormal_basis(normal, first, second);
  float turn = 2.0 * PI * turn_and_shift.x;
  f.tangent = cos(turn) * first + sin(turn) * second;
  f.bitangent = cross(normal, f.tangent);
  f.shift = turn_and_shift.yz;
  return f;
}
