// What grass reflects, in a scene that has none: nothing. Where a scene has grass, grass/light.glsl is included in place of
// this file (addon/gfx/interface.py).
struct GrassSeen {
  bool exists;
};

GrassSeen grass_see(ivec2 pixel, Surface s)
{
  GrassSeen seen;
  seen.exists = false;
  return seen;
}

vec3 grass_reflection(GrassSeen seen, Surface s, vec3 direction)
{
  return vec3(0.0);
}
