// Mean over the sixteen patterns of neighbouring pixels, of those that lie on the same plane: shares that they found by
// different points of the light together. Neighbours whose share differs by more than patterns do are left out. Five by five pixels, the rim counted half, hold each pattern equally often.
#include "ask/view.glsl"
#include "lib/math.glsl"
#include "edges/light.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = receivers_size();
  if (pixel.x >= size.x || pixel.y >= size.y) {
    return;
  }
  vec4 receiver = receivers_fetch(pixel);
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  float pixel_size = view_growth(receiver.xyz) * view_pixel();
  // What two patterns differ by in a penumbra; by more than that shadow itself varies.
  float noise = 0.5 * inversesqrt(float(edge_light.point_count));
  float own = raw_share_fetch(pixel).x;
  float total = 0.0;
  float sum = 0.0;
  for (int k = 0; k < 25; k++) {
    ivec2 offset = ivec2(k % 5 - 2, k / 5 - 2);
    ivec2 other = clamp(pixel + offset, ivec2(0), size - 1);
    vec4 beside = receivers_fetch(other);
    bool alike = other == pixel + offset && beside.w == receiver.w && receiver.w != 0.0
                 && dot(octahedral_decode(surface_normal_fetch(other).zw), normal) > 0.9
                 && abs(dot(beside.xyz - receiver.xyz, normal)) < 2.0 * pixel_size;
    float share = raw_share_fetch(other).x;
    float weight = ((abs(offset.x) == 2) ? 0.5 : 1.0) * ((abs(offset.y) == 2) ? 0.5 : 1.0);
    if (alike && abs(share - own) < noise) {
      total += weight;
      sum += weight * share;
    }
  }
  own = (total > 0.0) ? sum / total : own;
  imageStore(seen_share, pixel + ivec2(0, edge_light.picture_row), vec4(own, 0.0, 0.0, 0.0));
}
