// Texels of the list of objects that scatter, see OBJECT_TEXELS of subsurface/image.glsl. A program that includes this binds
// `scatter_objects`.
vec4 object_texel(int index)
{
  return scatter_objects_fetch(ivec2(index & 2047, index >> 11));
}
