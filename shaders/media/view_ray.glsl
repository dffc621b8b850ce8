// The view ray of a pixel, from the camera's clip start, where Cycles' rays begin, up to the surface that it sees.
#include "film/view_direction.glsl"

struct ViewRay {
  vec3 origin;
  vec3 direction;
  float limit;  // distance of the surface; FARTHEST_MEDIUM where there is none
  bool hit;
  float before;  // distance of its origin from the eye
};

// `seen`: of the image of positions; `place`: on the film, in pixels.
ViewRay view_ray(vec4 seen, vec2 place)
{
  ViewRay ray;
  ray.hit = seen.w != 0.0;
  ray.direction = view_direction(place);
  ray.origin = film_view.eye.xyz;
  if (film_view.eye.w > 0.5) {
    vec2 on_frame = mix(film_view.frame.xz, film_view.frame.yw,
                        (place + vec2(film_view.right.w, film_view.up.w)) / film_view.film.xy);
    ray.origin += on_frame.x * film_view.right.xyz + on_frame.y * film_view.up.xyz;
  }
  ray.limit = FARTHEST_MEDIUM;
  if (ray.hit) {
    vec3 away = seen.xyz - ray.origin;
    ray.limit = max(dot(away, ray.direction), 0.0);
    if (film_view.eye.w <= 0.5) {
      ray.direction = safe_normalize(away);
      ray.limit = length(away);
    }
  }
  ray.before = film_view.film.z / max(-dot(ray.direction, film_view.backward.xyz), 1e-3);
  ray.origin += ray.before * ray.direction;
  ray.limit = max(ray.limit - ray.before, 0.0);
  return ray;
}
