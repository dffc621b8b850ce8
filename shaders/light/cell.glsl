// What is stored of a cell between four pixels: the octahedral normal of its plane and that plane's distance from the
// origin; w: in four bits which corners lie on it, in four more which lights it knows.

ivec2 cell_corner(int k)
{
  return ivec2(k & 1, k >> 1);
}

float cell_pack(bvec4 on_plane, bvec4 known)
{
  vec4 bit = vec4(1.0, 2.0, 4.0, 8.0);
  return any(on_plane) ? dot(vec4(on_plane), bit) + 16.0 * dot(vec4(known), bit) : 0.0;
}

void cell_unpack(float stored, out vec4 on_plane, out bvec4 known)
{
  ivec4 bits = ivec4(int(stored)) >> ivec4(0, 1, 2, 3);
  on_plane = vec4(bits & 1);
  known = notEqual(bits & 16, ivec4(0));
}
