// Of a view of any kind, a lamp's or the camera's.

// Whether all rays of a view run alongside one another: it is orthographic, and where its `eye` stands says nothing.
bool view_is_parallel(vec4 eye)
{
  return eye.w > 0.5;
}
