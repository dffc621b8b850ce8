// A grid along the view: columns of pixels, cut into slices by distance from the eye, one atlas with slice above slice.
//
// Slices are even in w = d / (d + scale), whose whole range is 0 to 1: `froxel_range` holds w where media begin and end,
// and the scale. The grid is shifted by a part of a cell in each sample (`froxel_shift`), so that the mean over samples has
// no edges of cells. Made by addon/lighting/froxels.py. A program has froxel_shape: columns, rows, slices, pixels of a side.

ivec3 froxel_of(ivec2 texel)
{
  return ivec3(texel.x, texel.y % froxel_shape.y, texel.y / froxel_shape.y);
}

ivec2 froxel_texel(ivec3 cell)
{
  return ivec2(cell.x, cell.z * froxel_shape.y + cell.y);
}

// A place of the film in a cell, in pixels.
vec2 froxel_pixel(ivec3 cell, vec2 u)
{
  return (vec2(cell.xy) + u - froxel_shift) * float(froxel_shape.w);
}

float froxel_distance(float slice)
{
  float w = mix(froxel_range.x, froxel_range.y, slice / float(froxel_shape.z));
  return froxel_range.z * w / max(1.0 - w, 1e-6);
}

// Where in the grid a place is, in cells.
vec3 froxel_place(vec2 pixel, float away)
{
  float w = away / (away + froxel_range.z);
  float slice = (w - froxel_range.x) / max(froxel_range.y - froxel_range.x, 1e-6) * float(froxel_shape.z);
  return vec3(pixel / float(froxel_shape.w) + froxel_shift, slice);
}
