// Visibility that the edges of a light gave before (lighting/edge_shadows.py): with SEEN_POINTS a bit of each of the points
// that the light is sampled by, which have a row each; else the light's share, one picture above the other.
#include "light/sources.glsl"

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  int height = surface_position_size().y;
#ifdef SEEN_POINTS
  int point = light.first_view % SEEN_POINTS;
  int row = pixel.y + height * (2 * (light.first_view / SEEN_POINTS) + (point >> 5));
  return ((seen_points_fetch(ivec2(pixel.x, row)).x >> uint(point & 31)) & 1u) != 0u ? 1.0 : 0.0;
#else
  return seen_share_fetch(ivec2(pixel.x, pixel.y + height * light.first_view)).x;
#endif
}
