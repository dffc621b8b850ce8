// Where the entries of a list lie (addon/frame/lists.py): runs of RUN one above the other in so many rows, so that some of
// the rows hold their share of it.
ivec2 entry_place(int index, int rows)
{
  int run = index / RUN;
  return ivec2((run / rows) * RUN + index % RUN, run % rows);
}

int entry_index(ivec2 place, int rows)
{
  return ((place.x / RUN) * rows + place.y) * RUN + place.x % RUN;
}
