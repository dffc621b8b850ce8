// A photon on the receivers that a light's view shows: irradiance, W/m2, texel by texel.
#include "lib/gbuffer.glsl"
#include "caustics/receiver.glsl"
#include "caustics/arrival.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = receiver_position_fetch(texel);
  out_irradiance = vec4(0.0);
  if (place.w == 0.0 || !arrives_on_diffuse(splat_centre.w)) {
    discard;
  }
  vec3 normal = octahedral_decode(receiver_normal_fetch(texel).zw);
  out_irradiance = vec4(photon_irradiance(place.xyz, normal, 0.05 * length(splat_first.xyz)), 0.0);
}
