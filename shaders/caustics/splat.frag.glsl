// A photon on the picture: the light that the diffuse closure of a pixel reflects of it.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "caustics/receiver.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 place = surface_position_fetch(pixel);
  out_light = vec4(0.0);
  if (place.w == 0.0) {
    discard;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  float width = view_pixel() * view_growth_ahead(place.xyz);
  vec3 arriving = photon_irradiance(place.xyz, normal, 0.05 * width);
  out_light = vec4(arriving * surface_diffuse_fetch(pixel).rgb / PI, 0.0);
}
