// Direction of the ray through a place of the film, in pixels.
#include "lib/math.glsl"

vec3 view_direction(vec2 pixel)
{
  vec2 place = (pixel + vec2(film_view.right.w, film_view.up.w)) / film_view.film.xy;
  vec2 on_frame = mix(film_view.frame.xz, film_view.frame.yw, place);
  if (film_view.eye.w > 0.5) {
    return -film_view.backward.xyz;
  }
  return safe_normalize(on_frame.x * film_view.right.xyz + on_frame.y * film_view.up.xyz - film_view.backward.xyz);
}
