// What light below their surfaces leaves objects, in a scene in which none is walked: nothing. Where one is, subsurface/leaving.glsl
// is included in place of this file (addon/gfx/interface.py).
bool light_leaves(int material, vec3 position, vec3 normal, vec3 to_viewer, uint salt, out vec3 sent, out vec3 part,
                  out vec3 same, out bool in_glass)
{
  sent = part = same = vec3(0.0);
  in_glass = false;
  return false;
}
