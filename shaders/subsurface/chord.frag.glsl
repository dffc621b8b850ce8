// For points on an object: its depth and the mean length of lines from there through it, m, by rays of the cosine's density
// inwards, the shading normal, and how translucent the surface is there. What no ray leaves again, since the mesh is open,
// counts as `longest`. The depth is the harmonic mean of lengths: 1.5 times a slab's thickness, a ball's radius;
// and no more than the radius of curvature.
//
// Of Burley's method, in place of the mean length: how much of its profile Cycles counts in the window of pixels, over what a plane
// has there, packed and below zero. Contours finer than cells count there, too.
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "subsurface/walks.glsl"
#include "subsurface/lines.glsl"

#define CHORDS 32
#define LINES 48  // of each axis and channel alike
#define HITS 4    // of a line, as in Cycles

// Lines along the normal, half of them, and two tangents, at distances of the profile's density, as Cycles finds places; the power
// heuristic between axes. Each place counts by the profile at its distance, by what it faces and the window.
vec3 lines_found(vec3 place, vec3 normal, vec3 d, float instance, float range, uvec3 roll)
{
  Profile profile = burley_profile(d);
  vec3 found = vec3(0.0);
  vec3 plane = vec3(1e-20);
  vec3 t;
  vec3 b;
  orthonormal_basis(normal, t, b);
  float shift = to_unit(roll.x);
  float offset = ray_offset(place);
  ivec2 hit;
  bool met = own_surface(place + offset * normal, -normal, 4.0 * offset, instance, roll.x, hit) < 4.0 * offset;
  float outside = (met && dot(triangle_normal(hit), normal) < 0.0) ? -1.0 : 1.0;  // of triangles as they are wound
  for (int k = 0; k < LINES; k++) {
    roll = hash3(roll);
    int way = k & 3;
    vec3 axis = (way < 2) ? normal : (way == 2) ? t : b;
    vec3 u = (way < 2) ? t : (way == 2) ? b : normal;
    vec3 v = cross(axis, u);
    float length_m = d[(k >> 2) % 3] * ((to_unit(roll.y) < 0.25) ? 1.0 : 3.0);
    float share = fract(shift + 0.61803399 * float(k));
    float foot = -length_m * log(max(1.0 - share, 1e-6));
    vec3 drawn = profile_radial(profile, foot);
    float density = (drawn.x + drawn.y + drawn.z) / 3.0;
    plane += (way < 2) ? 2.0 * near_window(foot, range) * drawn / density : vec3(0.0);
    if (foot >= range) {
      continue;
    }
    float angle = 2.0 * PI * to_unit(roll.z);
    float height = sqrt(range * range - foot * foot);
    vec3 origin = place + foot * (cos(angle) * u + sin(angle) * v) + height * axis;
    float begun = 0.0;
    for (int hits = 0; hits < HITS; hits++) {
      begun += own_surface(origin - begun * axis, -axis, 2.0 * height - begun, instance, roll.x + uint(hits), hit);
      if (begun >= 2.0 * height) {
        break;
      }
      vec3 facing = outside * triangle_normal(hit);
      vec3 densities = vec3(0.5, 0.25, 0.25) * abs(vec3(dot(facing, normal), dot(facing, t), dot(facing, b)));
      float own = (way < 2) ? densities.x : (way == 2) ? densities.y : densities.z;
      float away = max(length(origin - begun * axis - place), foot);
      float counts = near_window(away, range) * smoothstep(-0.2, 0.4, dot(facing, normal));
      found += profile_radial(profile, away) * (counts * foot / away * own / max(dot(densities, densities), 1e-12) / density);
      begun += offset;
    }
  }
  return found / plane;
}

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = point_position_fetch(texel);
  vec4 normals = point_normal_fetch(texel);
  vec3 face = octahedral_decode(normals.zw);
  vec3 origin = ray_origin(place.xyz, -face);
  uvec3 roll = hash3(uvec3(uvec2(texel), 5u));
  float sum = 0.0;
  float per = 0.0;
  for (int k = 0; k < CHORDS; k++) {
    vec2 u = fract(vec2(to_unit(roll.x), to_unit(roll.y)) + vec2(float(k) / float(CHORDS), to_unit(reverse_bits(uint(k)))));
    ivec2 hit;
    vec3 direction = cosine_direction(-face, u);
    float d = min(trace_until(origin, direction, longest, 0.0, roll.z + uint(k), hit), longest);
    sum += d;
    per += 1.0 / max(d, 1e-20);
  }
  float third = sum / float(CHORDS);
  vec4 belongs = point_instances_fetch(texel);
  int material = int(belongs.w + 0.5);
  vec4 length_m = scatter_means_fetch(ivec2(material & 15, material >> 4));
  if (place.w > 0.0 && int(length_m.w + 0.5) == SCATTER_BURLEY) {
    int listed = first_object + OBJECT_TEXELS * int(belongs.x + 0.5);
    vec4 object = scatter_objects_fetch(ivec2(listed & 2047, listed >> 11));
    third = pack_lines(lines_found(place.xyz, face, max(length_m.xyz, vec3(LEAST_SCALE)), object.w, RANGE * object.z, roll), roll);
  }
  out_shape = vec4(pack_normal(octahedral_decode(normals.xy)), min(float(CHORDS) / per, point_curve_fetch(texel).x), third, point_entry_fetch(texel).w);
}
