// Puts entries of `texels` texels into their places in a list (images.LIST_WIDTH). In `entries` each is followed by a texel
// that holds its number.
void main()
{
  int i = int(gl_GlobalInvocationID.x) + 65536 * int(gl_GlobalInvocationID.y);
  if (i >= count * texels) {
    return;
  }
  int entry = i / texels;
  int own = i - entry * texels;
  int from = entry * (texels + 1) + own;
  int named = entry * (texels + 1) + texels;
  int place = int(entries_fetch(ivec2(named & 2047, named >> 11)).x) * texels + own;
  imageStore(into, ivec2(place & 2047, place >> 11), entries_fetch(ivec2(from & 2047, from >> 11)));
}
