// Light linking: `receiver_groups` holds, in x, the group of receivers of the object that each pixel shows
// (addon/lighting/linked.py), and a light has a bit for each group that it does not light.
int receiver_group(ivec2 pixel)
{
  return int(receiver_groups_fetch(pixel).x + 0.5);
}

bool light_leaves_out(Light light, int group)
{
  return ((light.unlit >> group) & 1) != 0;
}
