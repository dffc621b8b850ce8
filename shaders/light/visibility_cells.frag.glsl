// Cells between four pixels at which visibility was looked up: the plane on which two or more of them lie, which of them
// do, and which lights are seen alike from those, or vary in proportion (light/cell.glsl).
#include "lib/gbuffer.glsl"
#include "light/cell.glsl"
#include "neighbours/pixel_size.glsl"

// Largest second difference along the edges of a cell, which reach one corner further on both sides.
vec4 bend_at(ivec2 cell)
{
  ivec2 last = visibility_size() - 1;
  vec4 bend = vec4(0.0);
  for (int axis = 0; axis < 2; axis++) {
    ivec2 along = (axis == 0) ? ivec2(1, 0) : ivec2(0, 1);
    for (int side = 0; side < 2; side++) {
      ivec2 corner = cell + side * along.yx;
      vec4 a = visibility_fetch(clamp(corner - along, ivec2(0), last));
      vec4 b = visibility_fetch(corner);
      vec4 c = visibility_fetch(min(corner + along, last));
      vec4 d = visibility_fetch(min(corner + 2 * along, last));
      bend = max(bend, max(abs(a - 2.0 * b + c), abs(b - 2.0 * c + d)));
    }
  }
  return bend;
}

void main()
{
  ivec2 cell = ivec2(gl_FragCoord.xy);
  vec3 normals[4];
  vec4 positions[4];
  for (int k = 0; k < 4; k++) {
    ivec2 pixel = min((cell + cell_corner(k)) * RATE, surface_position_size() - 1);
    positions[k] = surface_position_fetch(pixel);
    normals[k] = octahedral_decode(surface_normal_fetch(pixel).zw);
  }
  vec3 normal = vec3(0.0, 0.0, 1.0);
  float height = 0.0;
  bvec4 on_plane = bvec4(false);
  int most = 1;
  for (int k = 0; k < 4; k++) {
    if (positions[k].w == 0.0) {
      continue;
    }
    float reach = OFF_PLANE * pixel_size_at(positions[k].xyz);
    bvec4 beside = bvec4(false);
    int count = 0;
    for (int j = 0; j < 4; j++) {
      float off = abs(dot(positions[j].xyz - positions[k].xyz, normals[k]));
      beside[j] = positions[j].w != 0.0 && dot(normals[j], normals[k]) > FACING && off < reach;
      count += beside[j] ? 1 : 0;
    }
    if (count > most) {
      most = count;
      on_plane = beside;
      normal = normals[k];
      height = dot(normal, positions[k].xyz);
    }
  }
  vec4 lowest = vec4(1.0);
  vec4 highest = vec4(0.0);
  for (int k = 0; k < 4; k++) {
    if (on_plane[k]) {
      vec4 seen = visibility_fetch(cell + cell_corner(k));
      lowest = min(lowest, seen);
      highest = max(highest, seen);
    }
  }
  // From fewer corners the bilinear mean of what they have is no plane.
  vec4 most_range = vec4(ALIKE);
  if (all(on_plane)) {
    most_range = mix(most_range, vec4(LINEAR), lessThanEqual(bend_at(cell), vec4(BEND)));
  }
  bvec4 known = lessThanEqual(highest - lowest, most_range);
  out_cell = vec4(octahedral_encode(normal), height, cell_pack(on_plane, known));
}
