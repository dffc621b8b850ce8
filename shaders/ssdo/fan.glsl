// Fans: half planes through the line of sight of a point, searched for what stands in their directions on the screen.
//
// With v towards the viewer, d across it and t the angle from v, a direction v cos t + d sin t has the cosine
// a cos t + b sin t to a normal n (a = n.v, b = n.d) and the solid angle sin t dt dphi. Up to t a fan holds, per radian
// of turn around v, the cosine-weighted solid angle
//
//   m(t) = integral of sin t (a cos t + b sin t) dt = (a sin^2 t + b (t - sin t cos t)) / 2
//
// A fan is 32 sectors of equal m, one bit each (Therrien, Levesque and Gilet 2023 take equal angles). All fans count
// alike if they are drawn through cosine-distributed directions: their density per radian is m / pi.
//
// A program that includes this binds the surface images and `film_view`, and has the constants `fan_count`,
// `step_count`, `farthest` and `thickness` (both in metres).
// Leaves out panoramas: a fan is a straight line in the picture.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "lib/random.glsl"
#include "ask/media.glsl"

// What media let pass between a surface and what it sees along a direction at a distance.
vec3 passing_to(vec3 position, vec3 direction, float range)
{
  uvec3 salt = hash3(uvec3(floatBitsToUint(direction.x), floatBitsToUint(direction.y), uint(film_view.sample_index)));
  return media_transmittance(position, direction, min(range, FARTHEST_MEDIUM), salt.x);
}

// Whether a pixel shows a surface with a diffuse closure, which is then read.
bool diffuse_surface(ivec2 pixel, out Surface s)
{
  s = SURFACE_READ(pixel);
  return s.hit && max_component(s.diffuse) > 0.0;
}

struct Fan {
  vec3 origin;
  vec3 toward;     // unit, to the viewer
  vec3 across;     // unit
  float a;
  float b;
  float first;     // angles between which the cosine is positive
  float last;
  float low;       // m(first)
  float span;      // m(last) - m(first)
  uint below;      // sectors under the surface itself
  float rounding;  // of borders to whole sectors, 0..1: right in the mean
  vec2 place;      // of the origin, pixels
  vec2 course;     // unit, pixels
  float reach;     // pixels
};

// A step along a fan: the piece of a surface's tangent plane between two places on the screen.
struct Patch {
  ivec2 texel;
  vec3 position;
  vec3 normal;
  bool faces;    // the fan's origin
  uint sectors;  // that it hides
  uint front;    // of these, those of the side that is seen
};

float fan_measure(Fan fan, float t)
{
  float s = sin(t);
  return 0.5 * (fan.a * s * s + fan.b * (t - s * cos(t)));
}

// The share of the fan, 0..1, up to an angle.
float fan_share(Fan fan, float t)
{
  if (t <= fan.first) {
    return 0.0;
  }
  return (t >= fan.last) ? 1.0 : clamp((fan_measure(fan, t) - fan.low) / fan.span, 0.0, 1.0);
}

float fan_angle(Fan fan, vec3 position)
{
  vec3 path = position - fan.origin;
  return atan(max(dot(path, fan.across), 0.0), dot(path, fan.toward));
}

// Direction up to which a share of the fan lies.
vec3 fan_direction(Fan fan, float share)
{
  float low = fan.first;
  float high = fan.last;
  for (int i = 0; i < 10; i++) {
    float middle = 0.5 * (low + high);
    bool before = fan_share(fan, middle) < share;
    low = before ? middle : low;
    high = before ? high : middle;
  }
  float t = 0.5 * (low + high);
  return cos(t) * fan.toward + sin(t) * fan.across;
}

uint fan_sectors(Fan fan, float from, float to)
{
  int first = int(from * 32.0 + fan.rounding);
  int end = int(to * 32.0 + fan.rounding);
  if (first >= 32 || end <= first) {
    return 0u;
  }
  uint up_to_end = (end >= 32) ? 0xFFFFFFFFu : (1u << uint(end)) - 1u;
  return up_to_end & ~((1u << uint(first)) - 1u);
}

// The ray through a place of the film, in pixels; its direction is one metre long along the camera's axis.
vec3 film_ray(vec2 place, out vec3 origin)
{
  vec2 on_frame = view_on_frame(place);
  vec3 aside = on_frame.x * film_view.right.xyz + on_frame.y * film_view.up.xyz;
  bool orthographic = view_is_parallel(film_view.eye);
  origin = film_view.eye.xyz + (orthographic ? aside : vec3(0.0));
  return (orthographic ? vec3(0.0) : aside) - film_view.backward.xyz;
}

// The fan through a direction. False if the surface's hemisphere holds nothing of it.
bool fan_begin(Surface s, vec2 place, vec3 direction, float rounding, out Fan fan)
{
  fan.origin = s.position;
  fan.toward = TO_VIEWER(s);
  vec3 bitangent;
  vec3 across = direction - dot(direction, fan.toward) * fan.toward;
  if (dot(across, across) > 1e-10) {
    fan.across = normalize(across);
  }
  else {
    orthonormal_basis(fan.toward, fan.across, bitangent);
  }
  fan.a = dot(s.normal, fan.toward);
  fan.b = dot(s.normal, fan.across);
  fan.first = (fan.a < 0.0) ? atan(-fan.a, fan.b) : 0.0;
  fan.last = (fan.a < 0.0) ? PI : atan(fan.a, -fan.b);
  fan.low = fan_measure(fan, fan.first);
  fan.span = fan_measure(fan, fan.last) - fan.low;
  fan.rounding = rounding;
  fan.place = place;
  if (!(fan.span > 1e-7)) {
    return false;
  }
  float horizon = atan(max(dot(s.geometric_normal, fan.toward), 0.0), -dot(s.geometric_normal, fan.across));
  fan.below = fan_sectors(fan, fan_share(fan, horizon), 1.0);

  vec4 p = vec4(s.position, 1.0);
  float w = dot(film_view.row_w, p);
  vec2 size = film_view.film.xy;
  vec2 clip = vec2(dot(film_view.row_x, p), dot(film_view.row_y, p));
  vec2 change = vec2(dot(film_view.row_x.xyz, fan.across), dot(film_view.row_y.xyz, fan.across)) * w
                - clip * dot(film_view.row_w.xyz, fan.across);
  vec2 pixels_per_metre = 0.5 * size * change / (w * w);
  float speed = length(pixels_per_metre);
  fan.course = pixels_per_metre / max(speed, 1e-30);
  vec2 room = mix(place, size - place, vec2(greaterThan(fan.course, vec2(0.0)))) / max(abs(fan.course), vec2(1e-6));
  fan.reach = max(min(min(room.x, room.y) - 0.01, speed * farthest), 0.0);
  return true;
}

// Where the ray through a place meets a patch's plane; near edges and at grazing angles, beside its position. w: depth.
vec4 patch_point(Patch found, vec2 place, float width, out vec3 ray)
{
  vec3 origin;
  ray = film_ray(place, origin);
  float depth = dot(found.position - origin, -film_view.backward.xyz);
  float slope = dot(found.normal, ray);
  float met = dot(found.normal, found.position - origin) / min(slope, -1e-12);
  float most = 32.0 * width * view_pixel() * (view_is_parallel(film_view.eye) ? 1.0 : depth);
  float end = clamp(met, max(depth - most, 0.1 * depth), depth + most);
  return vec4(origin + ray * end, end);
}

// Step number `index` of a fan, or false if it finds nothing within the radius. Steps widen with the distance. `last`:
// place on the course and depth of what the step before found.
bool fan_step(Fan fan, int index, vec2 u, inout vec2 last, out Patch found)
{
  vec3 along = (float(index) + vec3(0.0, u.x, 1.0)) / float(step_count);
  along *= along * fan.reach;
  float from = along.x;
  float at = along.y;
  float to = along.z;
  found.texel = ivec2(fan.place + fan.course * at);
  if (all(equal(found.texel, ivec2(fan.place)))) {
    return false;
  }
  vec4 position = surface_position_fetch(found.texel);
  vec2 before = last;
  last = vec2(at, (position.w == 0.0) ? 1e30 : view_depth(position.xyz));
  if (position.w == 0.0) {
    return false;
  }
  found.position = position.xyz;
  found.normal = octahedral_decode(surface_normal_fetch(found.texel).zw);
  vec3 path = found.position - fan.origin;
  float range = length(path);
  if (u.y < smoothstep(0.7 * farthest, farthest, range)) {
    return false;
  }
  found.faces = dot(found.normal, path) < -1e-3 * range;
  vec3 ray_from;
  vec3 ray_to;
  if (found.faces && before.x < from) {
    // The corner between this surface and the one found before lies anywhere between both.
    vec4 corner = patch_point(found, fan.place + fan.course * before.x, at - before.x, ray_from);
    from = (corner.w > before.y) ? before.x : from;
  }
  vec3 point_from = patch_point(found, fan.place + fan.course * from, to - from, ray_from).xyz;
  vec3 point_to = patch_point(found, fan.place + fan.course * to, to - from, ray_to).xyz;
  float angle_from = fan_angle(fan, point_from);
  float angle_to = fan_angle(fan, point_to);
  bool falling = angle_from > angle_to;
  // What lies behind the patch is as thick as asked: its shadow ends at the back of its farther end.
  vec3 back = falling ? point_from + normalize(ray_from) * thickness : point_to + normalize(ray_to) * thickness;
  float near = fan_share(fan, min(angle_from, angle_to));
  float end = max(angle_from, angle_to);
  found.front = fan_sectors(fan, near, fan_share(fan, end));
  found.sectors = fan_sectors(fan, near, fan_share(fan, max(end, fan_angle(fan, back))));
  return true;
}

// Two numbers of this sample for a pixel. Those of 4x4 neighbours are stratified too, for the filter over them.
vec2 tile_numbers(ivec2 pixel, int bits_first, int bits_second)
{
  uint tile = uint(pixel.x & 3) + 4u * uint(pixel.y & 3);
  uvec3 own = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 91u)) >> uvec3(4u);
  uint x = owen_scramble(uint(bits_first), uint(film_view.seed) + 17u) ^ (tile << 28u) ^ own.x;
  uint y = owen_scramble(uint(bits_second), uint(film_view.seed) + 29u) ^ reverse_bits(tile) ^ own.y;
  return vec2(to_unit(x), to_unit(y));
}

// Numbers of fan `index` out of those of its pixel: a lattice on the torus (Roberts' R2), for any number of fans.
vec2 fan_numbers(vec2 u, int index)
{
  return fract(u + float(index) * vec2(0.7548776662, 0.5698402910));
}

// What a surface reflects of light from a direction, over what a Lambertian one of its albedo would.
vec3 diffuse_weight(Surface s, vec3 viewer, vec3 direction)
{
  if (s.diffuse_roughness < 1e-5) {
    return vec3(1.0);
  }
  float cosine = max(dot(s.normal, direction), 1e-4);
  return surface_diffuse_reflection(s, viewer, direction) * (PI / cosine)
         / max(s.diffuse, vec3(1e-6));
}
