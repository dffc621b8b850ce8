// Puts the light of splats in the place of the direct light that entered, where anything scatters. Of channels whose range
// 1/sigma_tr is less than a pixel, or than half of what places lie apart, the direct light stays.
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
  vec3 position = surface_position_fetch(pixel).xyz;
  float cosine = clamp(dot(normal, view_toward(position)), 0.0, 1.0);
  float passes = 1.0 - fresnel_dielectric(cosine, scatter_walk_fetch(pixel).y);
  vec3 color = unpack_three(spread_length_fetch(pixel).w, 255.0);
  vec3 part = surface_diffuse_fetch(pixel).rgb * share.rgb / max(color, vec3(1e-3));  // 1 where all of the surface scatters
  vec4 light = light_direct_fetch(pixel);
  int object = scatter_object(share.w) - 1;
  float apart = splat_objects_fetch(ivec2(object & 2047, object >> 11)).x;
  float least = max(view_pixel() * view_growth_ahead(position), 0.5 * apart);
  vec3 spreads = smoothstep(vec3(0.5), vec3(1.0), vec3(1.0) / max(dipole_transport_fetch(pixel).rgb * least, vec3(1e-20)));
  vec4 entry = spread_entry_fetch(pixel);
  vec3 entered = share.rgb * entry.w;
  vec3 stays = vec3(1.0) - entered + entered * (vec3(1.0) - spreads) * entry.rgb;
  vec3 left = mix(vec3(0.0), spreads * splatted_fetch(pixel).rgb, greaterThan(spreads, vec3(0.0)));
  out_direct = vec4(light.rgb * stays + passes / PI * part * left, light.w);
}
