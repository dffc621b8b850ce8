// What a pixel of a panoramic camera sees: the functions of ask/view.glsl for those. The formulas, and their sources, are
// those of addon/snapshot/panorama.py, by the numbers of PROJECTIONS; directions are (right, up, forward) of the camera.
// `film_view` holds them: panorama, panorama_more: the values; panorama_film: what makes a pixel a place from 0 to 1;
// panorama_eye: the point of the lens, m, to the right and up, the distance in focus (0: all is), and the projection.
// panorama_stereo: an eye's offset to the right, where both converge (0: nowhere), altitudes over which it fades.
#include "lib/math.glsl"
#include "lib/view.glsl"

vec3 panorama_fisheye(vec2 place, float away, float angle)
{
  return vec3((away > 0.0) ? place * (sin(angle) / away) : vec2(0.0), cos(angle));
}

// Direction that a place of the film, from 0 to 1, sees; 0 where it sees nothing.
vec3 panorama_seen(vec2 place)
{
  int projection = int(film_view.panorama_eye.w);
  vec4 values = film_view.panorama;
  vec2 square = 2.0 * place - 1.0;
  if (projection == 1 || projection == 7) {
    float longitude = mix(values.x, values.y, place.x);
    float height = mix(values.z, values.w, place.y);
    float across = (projection == 1) ? cos(height) : 1.0;
    return vec3(across * sin(longitude), (projection == 1) ? sin(height) : height, across * cos(longitude));
  }
  if (projection == 2) {
    float away = length(square);
    return (away > 1.0) ? vec3(0.0) : panorama_fisheye(square, away, 0.5 * values.x * away);
  }
  if (projection == 3 || projection == 4) {
    vec2 sensor = (place - 0.5) * values.zw;
    float away = length(sensor);
    if (projection == 3) {
      // The sine of half the angle; that itself, by the inverse sine, has three digits on some drivers.
      float half_sine = min(away / (2.0 * values.y), 1.0);
      bool seen = away <= 2.0 * values.y * sin(0.25 * values.x);
      vec2 aside = sensor * (sqrt(max(1.0 - half_sine * half_sine, 0.0)) / values.y);
      return seen ? vec3(aside, 1.0 - 2.0 * half_sine * half_sine) : vec3(0.0);
    }
    vec4 more = film_view.panorama_more;
    float angle = -(values.y + away * (more.x + away * (more.y + away * (more.z + away * more.w))));
    return (abs(angle) > 0.5 * values.x) ? vec3(0.0) : panorama_fisheye(sensor, away, angle);
  }
  if (projection == 5) {
    float off = dot(square, square);
    float z = sqrt(max(1.0 - off, 0.0));
    return (off > 1.0) ? vec3(0.0) : vec3(2.0 * z * square, 2.0 * z * z - 1.0);
  }
  return vec3(tan(0.25 * PI * square.x), tan(0.25 * PI * square.y), 1.0);
}

// The angle to the axis by a polynomial of the distance from the middle, the other way round.
float panorama_away(float angle)
{
  vec4 more = film_view.panorama_more;
  float low = 0.0;
  float high = length(film_view.panorama.zw);
  for (int k = 0; k < 24; k++) {
    float middle = 0.5 * (low + high);
    bool less = -(film_view.panorama.y + middle * (more.x + middle * (more.y + middle * (more.z + middle * more.w)))) < angle;
    low = less ? middle : low;
    high = less ? high : middle;
  }
  return 0.5 * (low + high);
}

// The place of the film, from 0 to 1, that sees a unit direction; beyond that where none does.
vec2 panorama_place(vec3 seen)
{
  int projection = int(film_view.panorama_eye.w);
  vec4 values = film_view.panorama;
  float across = length(seen.xy);
  if (projection == 1 || projection == 7) {
    float longitude = atan(seen.x, seen.z);
    float height = (projection == 1) ? atan(seen.y, length(seen.xz)) : seen.y / max(length(seen.xz), 1e-6);
    return (vec2(longitude, height) - values.xz) / (values.yw - values.xz);
  }
  float angle = atan(across, seen.z);
  vec2 way = (across > 0.0) ? seen.xy / across : vec2(0.0);
  if (projection == 2) {
    return 0.5 + way * (angle / values.x);
  }
  if (projection == 3) {
    return 0.5 + way * (2.0 * values.y * sin(0.5 * angle)) / values.zw;
  }
  if (projection == 4) {
    return 0.5 + way * panorama_away(angle) / values.zw;
  }
  if (projection == 5) {
    return 0.5 + 0.5 * safe_normalize(seen + vec3(0.0, 0.0, 1.0)).xy;
  }
  return (seen.z > 0.0) ? 0.5 + atan(seen.xy / seen.z) * (2.0 / PI) : vec2(-1.0);
}

vec3 panorama_world(vec3 seen)
{
  return seen.x * film_view.right.xyz + seen.y * film_view.up.xyz - seen.z * film_view.backward.xyz;
}

vec3 panorama_camera(vec3 world)
{
  return vec3(dot(world, film_view.right.xyz), dot(world, film_view.up.xyz), -dot(world, film_view.backward.xyz));
}

// An eye of a stereoscopic pair stands on a circle, to the side of where it looks, and both may look at a point before them.
vec3 panorama_beside(vec3 seen)
{
  vec4 stereo = film_view.panorama_stereo;
  float altitude = atan(abs(seen.y), length(seen.xz));
  float fade = (stereo.w > 0.0) ? cos(0.5 * PI * clamp((altitude - stereo.z) / max(stereo.w - stereo.z, 1e-6), 0.0, 1.0)) : 1.0;
  return safe_normalize(vec3(seen.z, 0.0, -seen.x)) * (stereo.x * fade);
}

// From the middle of the lens, that lies across each direction, to this sample's point of it: the camera's axes, turned from
// its own direction to that one by the shortest way.
vec3 panorama_lens(vec3 seen)
{
  vec2 lens = film_view.panorama_eye.xy;
  vec3 between = seen + vec3(0.0, 0.0, 1.0);
  return vec3(lens, 0.0) - dot(seen.xy, lens) / max(1.0 + seen.z, 1e-3) * between;
}

// Where in the camera's own axes rays to a direction begin.
vec3 panorama_begins(vec3 seen)
{
  return panorama_beside(seen) + panorama_lens(seen);
}

// The direction of the ray of a place of the film, that sees `seen`, from where it begins.
vec3 panorama_onward(vec3 seen, vec3 begins)
{
  float convergence = film_view.panorama_stereo.y;
  float focus = film_view.panorama_eye.z;
  vec3 beside = panorama_beside(seen);
  vec3 onward = (convergence > 0.0) ? safe_normalize(convergence * seen - beside) : seen;
  return (focus > 0.0) ? onward * focus + beside - begins : onward;
}

vec3 panorama_of_pixel(vec2 place)
{
  vec2 jittered = place + vec2(film_view.right.w, film_view.up.w);
  return safe_normalize(panorama_seen(jittered * film_view.panorama_film.zw + film_view.panorama_film.xy));
}

bool view_sees(vec2 place)
{
  vec3 seen = panorama_of_pixel(place);
  return dot(seen, seen) > 0.5;
}

vec3 view_origin(vec2 place)
{
  return film_view.eye.xyz + panorama_world(panorama_begins(panorama_of_pixel(place)));
}

vec3 view_direction(vec2 place)
{
  vec3 seen = panorama_of_pixel(place);
  return (dot(seen, seen) > 0.5) ? safe_normalize(panorama_world(panorama_onward(seen, panorama_begins(seen)))) : vec3(0.0);
}

// The eye that sees a place.
vec3 panorama_eye(vec3 position)
{
  vec3 way = safe_normalize(panorama_camera(position - film_view.eye.xyz));
  return film_view.eye.xyz + panorama_world(panorama_begins(way));
}

float view_clip(vec3 direction)
{
  return film_view.film.z;
}

vec3 view_toward(vec3 position)
{
  return safe_normalize(panorama_eye(position) - position);
}

bool view_is_baked()
{
  return false;
}

vec3 view_of_surface(vec3 position, vec3 normal)
{
  return view_toward(position);
}

// Blender's passes have the distance as depth.
float view_depth(vec3 position)
{
  return length(film_view.eye.xyz - position);
}

float view_distance(vec3 position)
{
  return view_depth(position);
}

// In the mean over the picture.
float view_pixel()
{
  return (film_view.frame.y - film_view.frame.x) / film_view.film.x;
}

float view_growth(vec3 position)
{
  return view_depth(position);
}

float view_growth_ahead(vec3 position)
{
  return view_depth(position);
}

float view_reach(vec3 position)
{
  return view_depth(position);
}

bool view_place(vec3 position, out vec2 share)
{
  vec2 place = panorama_place(safe_normalize(panorama_camera(position - film_view.eye.xyz)));
  vec2 pixel = (place - film_view.panorama_film.xy) / film_view.panorama_film.zw - vec2(film_view.right.w, film_view.up.w);
  share = pixel / film_view.film.xy;
  return true;
}
