// A disc or triangle of a surface in the map of one virtual light: a square about it.
#include "ism/paraboloid.glsl"
#include "lib/random.glsl"

#define BLOCK 6.0  // radii of discs

vec4 entry_texel(int index)
{
  return surface_points_fetch(ivec2(index & 2047, index >> 11));
}

// Plane through an edge, upright on its triangle: distance of a place to one side of it is dot(xyz, place) + w.
vec4 edge_plane(vec3 from, vec3 to, vec3 up)
{
  vec3 across = safe_normalize(cross(up, to - from));
  return vec4(across, -dot(across, from));
}

void main()
{
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  gl_PointSize = 1.0;
  disc = vec4(0.0);
  plane = vec4(0.0);
  tile = vec3(0.0);
  first_bound = vec4(0.0);
  second_bound = vec4(0.0);
  third_bound = vec4(0.0);
  int map = gl_InstanceID;
  int run = (map + first_run) % run_count;
  int index = ENTRY_TEXELS * ((number < triangle_count) ? number : number + run * run_points);
  vec4 place = entry_texel(index);
  vec4 look = entry_texel(index + 1);
  vec4 first = entry_texel(index + 2);
  vec3 second = entry_texel(index + 3).xyz;
  bool whole = first.w > 0.5;
  float radius = sqrt(place.w);
  // What lets light pass stands in a share of the maps. Discs overlap, and random choices for each would add up to too much: those
  // of a block have one number, layers that are farther apart have their own.
  uvec3 block = whole ? uvec3(uint(abs(look.w))) : uvec3(ivec3(clamp(floor(place.xyz / (BLOCK * radius)), -1e9, 1e9)));
  if (to_unit(hash3(hash3(block) + uvec3(uint(map), uint(draw_seed), 0u)).x) >= look.z) {
    return;
  }
  vec3 origin = virtual_lights_fetch(ivec2(map, 0)).xyz;
  mat3 frame = map_frame(virtual_lights_fetch(ivec2(map, 1)).xyz);
  vec3 centre = (place.xyz - origin) * frame;
  vec3 normal = octahedral_decode(look.xy) * frame;
  float away = dot(centre, normal);
  float reach = length(centre);
  // Below the horizon lies what lights up nothing, and in the plane of the map's point its own surface. Of a closed thing
  // that is seen from outside, the fronts hide all that its backs do; discs of the backs would only stick out.
  bool outside = !whole && (any(greaterThan(first.xyz, origin)) || any(lessThan(second, origin)));
  bool below = centre.z <= (whole ? -radius : 1e-3 * reach) || abs(away) <= 1e-5 * max(reach, radius);
  bool back = outside && away > 0.0;
  float side_of = (away < 0.0) ? -1.0 : 1.0;
  if (half_extent > 0.0) {
    below = abs(normal.z) <= 1e-5;
    back = !whole && normal.z > 0.0;
    side_of = (normal.z < 0.0) ? -1.0 : 1.0;
  }
  disc = vec4(centre, radius * radius);
  plane = vec4(side_of * normal, side_of * away + BIAS * half_extent);
  if (below || plane.w <= 0.0 || (look.w < 0.0 && back)) {
    return;
  }
  tile.xy = vec2(float(map % map_columns), float(map / map_columns)) * float(map_side);
  if (whole) {
    vec3 corner = (first.xyz - origin) * frame;
    vec3 other = (second - origin) * frame;
    vec3 last = (entry_texel(index + 4).xyz - origin) * frame;
    tile.z = TRIANGLE;
    first_bound = edge_plane(corner, other, normal);
    second_bound = edge_plane(other, last, normal);
    third_bound = edge_plane(last, corner, normal);
  }
  else {
    bool within = all(lessThan(first.xyz, place.xyz - radius)) && all(greaterThan(second, place.xyz + radius));
    tile.z = within ? DISC : CUT_DISC;
    first_bound.xyz = first.xyz - origin;
    second_bound.xyz = second - origin;
  }
  // The cone about the disc is a circle in the map, from tan((a - b) / 2) to tan((a + b) / 2) off its middle.
  float sine = radius / max(reach, 1e-30);
  float cosine = sqrt(max(1.0 - sine * sine, 0.0));
  vec3 direction = centre / max(reach, 1e-30);
  vec2 middle = vec2(0.0);
  float size = 1.0;
  if (half_extent > 0.0) {
    middle = centre.xy / half_extent;
    size = radius / half_extent;
  }
  else if (sine < 0.95 && cosine + direction.z > 0.05) {
    middle = direction.xy / (cosine + direction.z);
    size = sine / (cosine + direction.z);
  }
  // A point whose middle lies outside the picture is left out whole: of a square that reaches into its map, it stays inside.
  vec2 inside = clamp(middle, vec2(-0.99), vec2(0.99));
  vec2 outside_by = abs(middle - inside);
  if (size < 1.0 && max(outside_by.x, outside_by.y) > size + 0.01) {
    return;
  }
  size += max(outside_by.x, outside_by.y);
  middle = inside;
  // No larger than the map, whose middle then serves as well.
  middle = (size >= 1.0) ? vec2(0.0) : middle;
  vec2 extent = float(map_side) * vec2(float(map_columns), float(map_rows));
  gl_PointSize = min(size, 1.0) * float(map_side) + 1.0;
  gl_Position = vec4(((middle * 0.5 + 0.5) * float(map_side) + tile.xy) / extent * 2.0 - 1.0, 0.0, 1.0);
}
