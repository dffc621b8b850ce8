// What a pixel of the picture sees, and where in the picture a place lies: of a camera with straight lines, perspective or
// orthographic. For a panoramic camera view/panorama.glsl is included in place of this file (addon/scene/panorama.py).
// A program that includes this binds `film_view`. A place of the film is in pixels, from the lower left corner of the picture.
#include "lib/math.glsl"
#include "lib/view.glsl"

// The place on the frame, one unit before the eye, that a place of the film shows.
vec2 view_on_frame(vec2 place)
{
  return mix(film_view.frame.xz, film_view.frame.yw, (place + vec2(film_view.right.w, film_view.up.w)) / film_view.film.xy);
}

// Whether any ray belongs to a place of the film.
bool view_sees(vec2 place)
{
  return true;
}

// Where the ray through a place of the film begins, and its direction, of length 1.
vec3 view_origin(vec2 place)
{
  vec3 origin = film_view.eye.xyz;
  if (view_is_parallel(film_view.eye)) {
    vec2 on_frame = view_on_frame(place);
    origin += on_frame.x * film_view.right.xyz + on_frame.y * film_view.up.xyz;
  }
  return origin;
}

vec3 view_direction(vec2 place)
{
  vec2 on_frame = view_on_frame(place);
  if (view_is_parallel(film_view.eye)) {
    return -film_view.backward.xyz;
  }
  return safe_normalize(on_frame.x * film_view.right.xyz + on_frame.y * film_view.up.xyz - film_view.backward.xyz);
}

// How far along a ray the camera's clip start lies.
float view_clip(vec3 direction)
{
  return film_view.film.z / max(-dot(direction, film_view.backward.xyz), 1e-3);
}

// Unit direction from a place to the viewer.
vec3 view_toward(vec3 position)
{
  return view_is_parallel(film_view.eye) ? film_view.backward.xyz : safe_normalize(film_view.eye.xyz - position);
}

// Whether the picture is a bake: each of its places is seen from above itself (eye.w of the view is 2), or from a camera
// that bends around corners as that of Cycles does (eye.w is below 0, or 1.25 where its rays are parallel).
bool view_is_baked()
{
  return film_view.eye.w > 1.1 || film_view.eye.w < 0.0;
}

#define BENT_OFFSET 0.2

// Unit direction from a place of a surface to whom sees it.
vec3 view_of_surface(vec3 position, vec3 normal)
{
  if (film_view.eye.w > 1.5) {
    return normal;
  }
  vec3 toward = view_toward(position);
  float above = dot(toward, normal);
  if (!view_is_baked() || above > BENT_OFFSET) {
    return toward;
  }
  vec3 raised = safe_normalize(toward - normal * (above - BENT_OFFSET));
  return (above <= 0.0) ? safe_normalize(mix(raised, normal, -above)) : raised;
}

// Distance along the axis, and that of a ray's place from where it begins.
float view_depth(vec3 position)
{
  return dot(film_view.eye.xyz - position, film_view.backward.xyz);
}

float view_distance(vec3 position)
{
  return view_is_parallel(film_view.eye) ? view_depth(position) : length(film_view.eye.xyz - position);
}

// Width of a pixel one unit before the eye, or at any place where rays are parallel.
float view_pixel()
{
  return (film_view.frame.y - film_view.frame.x) / film_view.film.x;
}

// What that grows by with a place: its distance from the eye, or what it is along the axis.
float view_growth(vec3 position)
{
  return view_is_parallel(film_view.eye) ? 1.0 : length(position - film_view.eye.xyz);
}

float view_growth_ahead(vec3 position)
{
  return view_is_parallel(film_view.eye) ? 1.0 : abs(dot(film_view.row_w, vec4(position, 1.0)));
}

// A length by which float32 errs about a place: its distance; where rays are parallel, what is seen is as wide as the picture.
float view_reach(vec3 position)
{
  return view_is_parallel(film_view.eye) ? film_view.frame.y - film_view.frame.x : length(position - film_view.eye.xyz);
}

// Where in the picture a place lies, as share of its width and height, which may lie beyond 0 to 1; false behind the eye.
bool view_place(vec3 position, out vec2 share)
{
  vec4 p = vec4(position, 1.0);
  float w = dot(film_view.row_w, p);
  share = vec2(dot(film_view.row_x, p), dot(film_view.row_y, p)) / w * 0.5 + 0.5;
  return w > 0.0;
}
