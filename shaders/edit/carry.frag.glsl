// An edit goes with a ray from where that has met its object.
void main()
{
  vec4 edit = met_edit_fetch(ivec2(gl_FragCoord.xy));
  if (dot(edit, edit) == 0.0) {
    discard;
  }
  out_edit = edit;
}
