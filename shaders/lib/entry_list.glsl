// Where the entries of a list lie (addon/kernels/lists.py): runs of RUN one above the other, in as many rows as the picture
// `surface_position` has, so that some rows of the list hold their share of it.
ivec2 entry_place(int index)
{
  int rows = surface_position_size().y;
  int run = index / RUN;
  return ivec2((run / rows) * RUN + index % RUN, run % rows);
}

int entry_index(ivec2 place)
{
  return ((place.x / RUN) * surface_position_size().y + place.y) * RUN + place.x % RUN;
}
