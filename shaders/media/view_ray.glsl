// The view ray of a pixel, from the camera's clip start, where Cycles' rays begin, up to the surface that it sees.
#include "ask/view.glsl"

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
  ray.origin = view_origin(place);
  ray.limit = view_sees(place) ? FARTHEST_MEDIUM : 0.0;
  if (ray.hit) {
    vec3 away = seen.xyz - ray.origin;
    ray.limit = max(dot(away, ray.direction), 0.0);
    if (!view_is_parallel(film_view.eye)) {
      ray.direction = safe_normalize(away);
      ray.limit = length(away);
    }
  }
  ray.before = view_clip(ray.direction);
  ray.origin += ray.before * ray.direction;
  ray.limit = max(ray.limit - ray.before, 0.0);
  return ray;
}

// Colour of layers before a place on it, at `t`: addon/surfaces/seen_layers.py.
vec3 layers_before(ivec2 pixel, float t)
{
#ifdef HAS_VIEW_LAYERS
  vec4 layers = view_layers_fetch(pixel);
  return (t > layers.w) ? layers.rgb : vec3(1.0);
#else
  return vec3(1.0);
#endif
}
