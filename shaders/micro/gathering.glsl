// Which point of a group gathers for all of it. Binds `tree_nodes`; constants leaf_count, group_count, buffer_choice.

vec4 tree_texel(int index)
{
  return tree_nodes_fetch(ivec2(index & 2047, index >> 11));
}

// Of a piece of a triangle its middle, not that of its longest edge.
vec3 leaf_middle(int leaf, out vec3 axis)
{
  axis = octahedral_decode(tree_texel(3 * leaf + 1).xy);
  vec4 sides = tree_texel(3 * leaf + 2);
  vec3 along = octahedral_decode(sides.xy);
  return tree_texel(3 * leaf).xyz + ((sides.w > 0.0) ? (sides.z * along + sides.w * cross(axis, along)) / 3.0 : vec3(0.0));
}

int gathering_leaf(int group)
{
  int group_size = leaf_count / group_count;
  return leaf_count + group * group_size + min(int(buffer_choice.x * float(group_size)), group_size - 1);
}
