// The dipole of each pixel's surface, where light leaves, for splats:
//
//   real       depth of the real source per channel, m; w: height of the virtual one over that
//   transport  sigma_tr per channel, 1/m; w: the object, as in subsurface/flux.glsl; 0: none
#include "lib/gbuffer.glsl"
#include "subsurface/image.glsl"
#include "subsurface/profile.glsl"
#include "subsurface/dipole.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_real = vec4(1.0);
  out_transport = vec4(0.0);
  vec4 share = scatter_share_fetch(pixel);
  if (share.w < 4.0) {
    return;
  }
  vec4 length_m = spread_length_fetch(pixel);
  vec3 color = unpack_three(length_m.w, 255.0);
  bool burley = scatter_method(share.w) == SCATTER_BURLEY;
  Dipole profile = dipole_of(burley, length_m.xyz, color, scatter_walk_fetch(pixel).y);
  out_real = vec4(profile.real, profile.slope);
  float object = float(scatter_object(share.w));
  out_transport = vec4(profile.transport, object + 0.5 * clamp(spread_entry_fetch(pixel).w, 0.0, 1.0));
}
