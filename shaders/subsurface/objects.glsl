// Texels of the list of objects that scatter, see OBJECT_TEXELS of subsurface/image.glsl. A program that includes this binds
// `scatter_objects`.
vec4 object_texel(int index)
{
  return scatter_objects_fetch(ivec2(index & 2047, index >> 11));
}

// Number of the object that scatters behind the front or the back of an instance's surface, from 1 on; 0: none.
int object_behind(float instance, bool back)
{
  vec4 sides = object_texel(int(instance));
  return int((back ? sides.y : sides.x) + 0.5);
}
