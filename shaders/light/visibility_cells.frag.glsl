// Cells between four pixels at which visibility is known: the plane on which most of them lie, if each light is
// seen alike from those (else 0), and, light by light, what is known at the corners, -1 beside the plane.
#include "lib/gbuffer.glsl"
#include "neighbours/pixel_size.glsl"

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
  vec4 range = highest - lowest;
  out_plane = (max(max_component(range.rgb), range.a) <= ALIKE) ? plane : vec4(0.0);
  out_first = vec4(known[0].x, known[1].x, known[2].x, known[3].x);
  out_second = vec4(known[0].y, known[1].y, known[2].y, known[3].y);
  out_third = vec4(known[0].z, known[1].z, known[2].z, known[3].z);
  out_fourth = vec4(known[0].w, known[1].w, known[2].w, known[3].w);
}
