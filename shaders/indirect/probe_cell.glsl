// Cells of space in which probes stand (probe_find.frag.glsl): they stay where they are while the camera moves. Their sides
// grow with the distance, in steps, such that about as many are seen everywhere in the picture.

#include "ask/view.glsl"

#define CELL_OFFSET vec3(0.37, 0.43, 0.31)  // walls stand at round numbers, cells should not end there

struct Cell {
  ivec3 place;
  float side;  // m
};

Cell cell_of(vec3 position)
{
  float picture = view_pixel() * sqrt(film_view.film.x * film_view.film.y);
  float wanted = max(picture * view_growth(position) * cell_share, 1e-12);
  Cell cell;
  cell.side = exp2(0.5 * floor(2.0 * log2(wanted) + 0.5));
  cell.place = ivec3(clamp(floor(position / cell.side + CELL_OFFSET), vec3(-1e9), vec3(1e9)));
  return cell;
}

// Random bits of a cell: who it is, whatever the picture.
uvec3 cell_bits(Cell cell)
{
  uint level = uint(int(floor(2.0 * log2(cell.side) + 0.5)));
  uvec3 bits = hash3(uvec3(cell.place) + uvec3(0u, 0u, level * 0x9E3779B1u));
  return hash3(bits ^ uvec3(uint(film_view.seed), 91u, 0u));
}

// Pixels among which probes are chosen: a grid of them, shifted in every sample.
ivec2 lattice_pixel(int index)
{
  vec2 cell = vec2(float(index % lattice.x), float(index / lattice.x));
  vec2 within = vec2(scrambled(film_view.bits_z, uint(film_view.seed) + 5u), scrambled(film_view.bits_w, uint(film_view.seed) + 6u));
  return ivec2((cell + within) / vec2(lattice) * vec2(surface_position_size()));
}
