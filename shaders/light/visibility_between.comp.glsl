// Visibility of up to four lights at all pixels, between those at which it was looked up: interpolated where a cell knows
// the light and the pixel's surface lies on its plane. All others look for themselves: they are listed, light by light, or,
// where shaders cannot count, marked by -1. Of the lights one above the other.
#include "lib/gbuffer.glsl"
#include "light/cell.glsl"
#include "neighbours/pixel_size.glsl"
#ifdef LISTED
#include "lib/entry_list.glsl"
#endif

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = surface_position_size();
  if (any(greaterThanEqual(pixel, size))) {
    return;
  }
  ivec2 cell = pixel / RATE;
  vec4 stored = cells_fetch(cell);
  vec4 on_plane;
  bvec4 known;
  cell_unpack(stored.w, on_plane, known);

  vec4 position = surface_position_fetch(pixel);
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  vec3 plane = octahedral_decode(stored.xy);
  float off = abs(dot(position.xyz, plane) - stored.z);
  bool lies_on = dot(plane, normal) > FACING && off < OFF_PLANE * pixel_size_at(position.xyz);

  vec2 share = vec2(pixel - cell * RATE) / vec2(max(min(ivec2(RATE), size - 1 - cell * RATE), ivec2(1)));
  vec4 weights = vec4(1.0 - share.x, share.x, 1.0 - share.x, share.x) * vec4(vec2(1.0 - share.y), vec2(share.y));
  bool at_corner = all(equal(weights * (1.0 - weights), vec4(0.0)));
  on_plane = at_corner ? vec4(1.0) : on_plane;
  weights *= on_plane;
  vec4 sum = vec4(0.0);
  vec4 most = vec4(0.0);
  for (int k = 0; k < 4; k++) {
    vec4 seen = visibility_fetch(cell + cell_corner(k));
    sum += weights[k] * seen;
    most = max(most, on_plane[k] * seen);
  }
  float whole = dot(weights, vec4(1.0));
  vec4 found = (whole > 0.0) ? clamp(sum / whole, vec4(0.0), vec4(1.0)) : most;
  for (int i = 0; i < light_count; i++) {
    bool tells = at_corner || position.w == 0.0 || (lies_on && known[i]);
#ifdef LISTED
    if (!tells) {
      int index = int(imageAtomicAdd(entry_count, ivec2(i, 0), 1u));
      uint entry = uint(pixel.x) | (uint(pixel.y) << 16);
      imageStore(entries, entry_place(index) + ivec2(0, i * size.y), uvec4(entry));
    }
#endif
    imageStore(pixel_visibility, pixel + ivec2(0, i * size.y), vec4(tells ? found[i] : -1.0));
  }
}
