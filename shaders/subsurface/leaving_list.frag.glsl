// Writes what leaves points into the list that subsurface/leaving.glsl reads, four texels for each: the mean, w: red of what leaves
// on the same side; the part, w: green of that; the slope, w: blue of that; the place.
#include "lib/gbuffer.glsl"
#include "subsurface/image.glsl"

#define BESIDE 4  // points on either side along the curve on which they stand

// Mean slope of points around that face alike.
vec3 slope_at(ivec2 texel)
{
  vec3 normal = octahedral_decode(point_normal_fetch(texel).xy);
  vec3 sum = vec3(0.0);
  float count = 0.0;
  for (int k = -BESIDE; k <= BESIDE; k++) {
    ivec2 other = ivec2(texel.x + k, texel.y);
    if (other.x >= 0 && other.x < ROW) {
      float alike = smoothstep(0.5, 0.9, dot(octahedral_decode(point_normal_fetch(other).xy), normal));
      sum += alike * cell_slope_fetch(other).rgb;
      count += alike;
    }
  }
  return sum / max(count, 1e-6);
}

void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy) - ivec2(0, 1);
  int index = place.y * 2048 + place.x;
  int cell = index >> 2;
  ivec2 texel = ivec2(cell & (ROW - 1), cell / ROW);
  out_texel = vec4(0.0);
  if (texel.y >= cell_sent_size().y) {
    return;
  }
  int kind = index & 3;
  vec3 same = cell_same_fetch(texel).rgb;
  out_texel = (kind == 0) ? vec4(cell_sent_fetch(texel).rgb, same.r) : (kind == 1) ? vec4(cell_part_fetch(texel).rgb, same.g)
            : (kind == 2) ? vec4(slope_at(texel), same.b) : point_position_fetch(texel);
}
