// Visibility of a light at a pixel of the picture.
#include "lib/gbuffer.glsl"
#include "light/terminator.glsl"
#include "light/whole.glsl"
#include "generated/visibility"

float visibility_at(ivec2 pixel, int index)
{
  Light light = light_read(index);
  if ((light.flags & LIGHT_SHADOW) == 0) {
    return 1.0;
  }
  vec4 normals = surface_normal_fetch(pixel);
  vec3 position = surface_position_fetch(pixel).xyz;
  vec3 facing = octahedral_decode(normals.zw);
  vec3 towards = LIGHT_IS(light, LIGHT_SUN) ? light.centre : safe_normalize(light.centre - position);
  vec3 normal = octahedral_decode(normals.xy);
  float lift = lift_decode(normals.zw);
  if (shines_through(lobe_kind(surface_lobe_fetch(pixel)), normal, towards)) {
    normal = -normal;
    facing = -facing;
    lift = 0.0;
  }
  vec3 start = light_start(position, normal, facing, lift, towards, facing);
  return light_visibility(light, pixel, start, facing);
}
