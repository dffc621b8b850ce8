// A photon on the picture: the light that the diffuse closure of a pixel reflects of it.
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
  float width = (film_view.frame.y - film_view.frame.x) / film_view.film.x
                * ((film_view.eye.w > 0.5) ? 1.0 : abs(dot(film_view.row_w, vec4(place.xyz, 1.0))));
  vec3 arriving = photon_irradiance(place.xyz, normal, 0.05 * width);
  out_light = vec4(arriving * surface_diffuse_fetch(pixel).rgb / PI, 0.0);
}
