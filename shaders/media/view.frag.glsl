// What the media let pass of the light that comes along each pixel's view ray from the surface, or from infinity; where a
// lamp is seen, which outshines what is behind it, from there. `around_eye`: what a solid absorbs that the eye is in.
// Leaves out links: it asks where lamps stand, not whom they light.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "ask/media.glsl"
#include "media/view_ray.glsl"
#include "light/sources.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ViewRay ray = view_ray(surface_position_fetch(pixel), gl_FragCoord.xy);
  for (int i = 0; i < light_count; i++) {
    float hit_distance;
    float density;
    vec3 radiance = light_hit(light_read(i), ray.origin, ray.direction, hit_distance, density);
    ray.limit = (max_component(abs(radiance)) > 0.0) ? min(ray.limit, hit_distance) : ray.limit;
  }
  uint salt = roll_of(pixel, film_view.sample_index, film_view.seed, 41).x;
  vec3 through = exp(-min(around_eye.rgb * ray.limit, vec3(1e30)));
#ifdef MEDIA_OF_CAMERA  // there are media, not only what a solid absorbs
  media_asked_by(MEDIA_OF_CAMERA);
  through *= media_transmittance_asked(ray.origin, ray.direction, ray.limit, salt);
#endif
  out_through = vec4(through, ray.hit ? 1.0 : 0.0);
}
