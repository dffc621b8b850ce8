// Light that points of the mesh receive from what has no view of its own, as places where it enters (subsurface/flux.glsl).
#include "lib/gbuffer.glsl"
#include "subsurface/flux.glsl"

void main()
{
  out_point = vec4(0.0);
  out_flux = vec4(0.0);
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = point_position_fetch(texel);
  if (place.w == 0.0) {
    return;
  }
  vec4 belongs = point_instances_fetch(texel);
  int object = int(belongs.x + 1.5);
  vec3 direct = (box_of(object) < 0.0) ? cell_whole_fetch(texel).rgb : cell_direct_fetch(texel).rgb;
  vec3 flux = PI * cells_fetch(texel).w * direct;  // of a white surface: the tint is in it
  enters(place.xyz, flux, -1.0, object, int(belongs.w + 0.5), point_entry_fetch(texel));
}
