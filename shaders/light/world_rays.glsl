// Directions of the world of each pixel's own, drawn from the table of its tile (addon/sources/world_tiles.py), and their
// visibility by rays. In place of the directions that the other lookups share among all pixels.
#include "light/sources.glsl"
#include "lib/environment.glsl"
#include "trace/rays.glsl"

// Last cell of the tile whose lower edge is not above `x`.
int world_cell(int tile, int cells, float x)
{
  int low = 0;
  int high = cells;
  while (high - low > 1) {
    int middle = (low + high) / 2;
    if (world_edges_fetch(ivec2(middle, tile)).r <= x) {
      low = middle;
    }
    else {
      high = middle;
    }
  }
  return low;
}

// `number`: of the `light_count` rays of this sample, which divide the cells among them.
Light own_point(Light light, int number)
{
  uvec3 salt = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(film_view.seed) + 23u));
  vec2 u = vec2((scrambled(film_view.bits_x, salt.x) + float(number)) / float(light_count),
                scrambled(film_view.bits_y, salt.y));
  ivec2 tile = ivec2(gl_FragCoord.xy / vec2(surface_position_size()) * vec2(world_tiles));
  int row = tile.y * world_tiles.x + tile.x;
  int cells = world_grid.x * world_grid.y;
  int place = world_cell(row, cells, u.x);
  float from = world_edges_fetch(ivec2(place, row)).r;
  float to = (place + 1 < cells) ? world_edges_fetch(ivec2(place + 1, row)).r : 1.0;
  float chance = max(to - from, 1e-9);
  vec2 cell = vec2(float(place % world_grid.x) + clamp((u.x - from) / chance, 0.0, 1.0),
                   float(place / world_grid.x) + u.y);
  float z = 2.0 * cell.y / float(world_grid.y) - 1.0;
  float azimuth = (cell.x / float(world_grid.x) - 0.5) * 2.0 * PI;
  float ring = sqrt(max(1.0 - z * z, 0.0));
  light.centre = vec3(ring * cos(azimuth), ring * sin(azimuth), z);
  light.radiance = environment_radiance(light.centre) * (4.0 * PI / (chance * float(cells * light_count)));
  // Lobes that trace rays share their light with the world's directions by this density; any that both sides name alike
  // keeps the sum, and narrow lobes know this one.
  light.area = environment_density(light.centre);
  return light;
}

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  uvec3 salt = roll_of(pixel, film_view.sample_index, film_view.seed, 17);
  return clear_path(ray_origin(position, normal), light.centre, 1e29, salt.x);
}
