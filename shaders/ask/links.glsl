// Which receivers a light leaves out, where no light of the pass leaves out any. Where one does, light/links.glsl is
// included in place of this file (addon/gfx/interface.py).
int receiver_group(ivec2 pixel)
{
  return 0;
}

bool light_leaves_out(Light light, int group)
{
  return false;
}
