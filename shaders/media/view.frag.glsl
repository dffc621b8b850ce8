// What the media let pass of the light that comes along each pixel's view ray from the surface, or from infinity.
#include "media/media.glsl"
#include "media/view_ray.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ViewRay ray = view_ray(surface_position_fetch(pixel), gl_FragCoord.xy);
  uint salt = roll_of(pixel, film_view.sample_index, film_view.seed, 41).x;
  out_through = vec4(media_transmittance(ray.origin, ray.direction, ray.limit, salt), ray.hit ? 1.0 : 0.0);
}
