// Cells between four pixels at which visibility was looked up: the plane on which two or more of them lie, and, light by
// light, its visibility at the corners: -1 beside the plane, and at all where it neither is alike nor varies in proportion.
#include "lib/gbuffer.glsl"
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
  vec4 known[4];
  for (int k = 0; k < 4; k++) {
    ivec2 corner = cell + ivec2(k & 1, k >> 1);
    ivec2 pixel = min(corner * RATE, surface_position_size() - 1);
    positions[k] = surface_position_fetch(pixel);
    normals[k] = octahedral_decode(surface_normal_fetch(pixel).zw);
    known[k] = visibility_fetch(corner);
  }
  vec4 plane = vec4(0.0);
  bvec4 on_plane = bvec4(false);
  int most = 1;
  for (int k = 0; k < 4; k++) {
    if (positions[k].w == 0.0) {
      continue;
    }
    float reach = OFF_PLANE * pixel_size_at(positions[k].xyz);
    bvec4 alike = bvec4(false);
    int count = 0;
    for (int j = 0; j < 4; j++) {
      float off = abs(dot(positions[j].xyz - positions[k].xyz, normals[k]));
      alike[j] = positions[j].w != 0.0 && dot(normals[j], normals[k]) > FACING && off < reach;
      count += alike[j] ? 1 : 0;
    }
    if (count > most) {
      most = count;
      on_plane = alike;
      plane = vec4(normals[k], dot(normals[k], positions[k].xyz));
    }
  }
  vec4 lowest = vec4(1.0);
  vec4 highest = vec4(0.0);
  for (int k = 0; k < 4; k++) {
    if (on_plane[k]) {
      lowest = min(lowest, known[k]);
      highest = max(highest, known[k]);
    }
    else {
      known[k] = vec4(-1.0);
    }
  }
  // From fewer corners the bilinear mean of what they have is no plane.
  vec4 most_range = vec4(ALIKE);
  if (all(on_plane)) {
    most_range = mix(most_range, vec4(LINEAR), lessThanEqual(bend_at(cell), vec4(BEND)));
  }
  bvec4 tells = lessThanEqual(highest - lowest, most_range);
  for (int k = 0; k < 4; k++) {
    known[k] = mix(vec4(-1.0), known[k], tells);
  }
  out_plane = plane;
  out_corners_0 = vec4(known[0].x, known[1].x, known[2].x, known[3].x);
  out_corners_1 = vec4(known[0].y, known[1].y, known[2].y, known[3].y);
  out_corners_2 = vec4(known[0].z, known[1].z, known[2].z, known[3].z);
  out_corners_3 = vec4(known[0].w, known[1].w, known[2].w, known[3].w);
}
