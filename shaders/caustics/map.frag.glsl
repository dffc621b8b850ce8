// A photon on the receivers that a light's view shows: irradiance, W/m2, texel by texel; with ALL of what diffuse surfaces
// are not to have, too.
#include "lib/gbuffer.glsl"
#include "caustics/receiver.glsl"
#include "caustics/arrival.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = receiver_position_fetch(texel);
  out_irradiance = vec4(0.0);
#ifdef ALL
  bool taken = true;
#else
  bool taken = arrives_on_diffuse(splat_centre.w);
#endif
  if (place.w == 0.0 || !taken) {
    discard;
  }
  vec3 normal = octahedral_decode(receiver_normal_fetch(texel).zw);
  out_irradiance = vec4(photon_irradiance(place.xyz, normal, 0.05 * length(splat_first.xyz)), 0.0);
}
