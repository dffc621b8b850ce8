// Pixels that show the same cell have the same key; cells come in a random order, another one in every sample.
#include "lib/random.glsl"
#include "indirect/probe_cell.glsl"

void main()
{
  out_key = 0xFFFFFFFFu;
  ivec2 place = ivec2(gl_FragCoord.xy);
  int index = place.y * LIST_COLUMNS + place.x;
  if (index >= lattice.x * lattice.y) {
    return;
  }
  vec4 position = surface_position_fetch(lattice_pixel(index));
  if (position.w == 0.0) {
    return;
  }
  uvec3 bits = cell_bits(cell_of(position.xyz));
  out_key = min(hash3(bits + uvec3(0u, 0u, uint(film_view.sample_index))).y, 0xFFFFFFFEu);
}
