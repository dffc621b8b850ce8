// How a pixel's light below the surface is laid out in four images, written by surface/scatter.frag.glsl:
//
//   length  length of the profile per channel, m (Burley's d, or the walk's mean free path); w: albedo that decides the
//           profile's shape, 8 bits a channel
//   share   part of the diffuse albedo per channel whose light enters elsewhere; w: 0 none, else the object's number from 1
//           on times 4, the method (SCATTER_*), and as a fraction the cosine at which the view's ray enters
//   walk    of the interface that the view's ray enters by: roughness squared, index of refraction
//   entry   painted: tint of the light that enters here; w: how translucent the surface is here
#include "lib/math.glsl"

#define ROW 64           // cells of an object in a row of images of points (addon/scene/scatter_points.py)
#define OBJECT_TEXELS 3  // first row, rows, spacing in m, instance; the grid's corner, voxel's size; its voxels, first texel

float scatter_code(int object, int method, float entry)
{
  return float(object * 4 + method) + clamp(entry, 0.0, 1.0) * 0.99;
}

int scatter_object(float code)
{
  return int(floor(code * 0.25));
}

int scatter_method(float code)
{
  return int(floor(code)) - 4 * scatter_object(code);
}

float scatter_cosine(float code)
{
  return fract(code) / 0.99;
}
