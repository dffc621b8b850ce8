// Puts the light of splats in the place of the direct light that entered, where anything scatters.
#include "lib/gbuffer.glsl"
#include "lib/closure.glsl"
#include "subsurface/image.glsl"
#include "ask/view.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 share = scatter_share_fetch(pixel);
  if (share.w < 4.0) {
    discard;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).xy);
  float cosine = clamp(dot(normal, view_toward(surface_position_fetch(pixel).xyz)), 0.0, 1.0);
  float passes = 1.0 - fresnel_dielectric(cosine, scatter_walk_fetch(pixel).y);
  vec3 color = unpack_three(spread_length_fetch(pixel).w, 255.0);
  vec3 part = surface_diffuse_fetch(pixel).rgb * share.rgb / max(color, vec3(1e-3));  // 1 where all of the surface scatters
  vec4 light = light_direct_fetch(pixel);
  vec3 stays = vec3(1.0) - share.rgb * spread_entry_fetch(pixel).w;
  out_direct = vec4(light.rgb * stays + passes / PI * part * splatted_fetch(pixel).rgb, light.w);
}
