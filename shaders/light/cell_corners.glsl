// What is known of a light at the corners of a cell (light/visibility_cells.frag.glsl), below 0 where nothing is.
vec4 cell_corners(ivec2 cell, int index)
{
  return (index < 2) ? ((index == 0) ? corners_0_fetch(cell) : corners_1_fetch(cell))
                     : ((index == 2) ? corners_2_fetch(cell) : corners_3_fetch(cell));
}
