// Writes what leaves points into the list that subsurface/leaving.glsl reads, five texels for each: the mean, w: red of what leaves
// on the same side; the part, w: green of that; the slope, w: blue of that; the place; the lean of each channel.
#include "lib/gbuffer.glsl"
#include "subsurface/image.glsl"
#include "subsurface/lean.glsl"

#define BESIDE 4  // points on either side along the curve on which they stand

// Mean slope of points around that face alike, and of how they lean.
vec3 slope_at(ivec2 texel, out mat3 lean)
{
  vec3 normal = octahedral_decode(point_normal_fetch(texel).xy);
  vec3 sum = vec3(0.0);
  float count = 0.0;
  lean = mat3(0.0);
  for (int k = -BESIDE; k <= BESIDE; k++) {
    ivec2 other = ivec2(texel.x + k, texel.y);
    if (other.x >= 0 && other.x < ROW) {
      float alike = smoothstep(0.5, 0.9, dot(octahedral_decode(point_normal_fetch(other).xy), normal));
      sum += alike * cell_slope_fetch(other).rgb;
      vec3 leans = cell_lean_fetch(other).xyz;
      lean += alike * mat3(unpack_lean(leans.x), unpack_lean(leans.y), unpack_lean(leans.z));
      count += alike;
    }
  }
  lean /= max(count, 1e-6);
  return sum / max(count, 1e-6);
}

void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy) - ivec2(0, 1);
  int index = place.y * 2048 + place.x;
  int cell = index / 5;
  ivec2 texel = ivec2(cell & (ROW - 1), cell / ROW);
  out_texel = vec4(0.0);
  if (texel.y >= cell_sent_size().y) {
    return;
  }
  int kind = index - 5 * cell;
  vec3 same = cell_same_fetch(texel).rgb;
  mat3 lean = mat3(0.0);
  vec3 slope = (kind == 2 || kind == 4) ? slope_at(texel, lean) : vec3(0.0);
  out_texel = (kind == 0) ? vec4(cell_sent_fetch(texel).rgb, same.r) : (kind == 1) ? vec4(cell_part_fetch(texel).rgb, same.g)
            : (kind == 2) ? vec4(slope, same.b) : (kind == 3) ? vec4(point_position_fetch(texel).xyz, 0.0)
            : vec4(pack_lean(lean[0]), pack_lean(lean[1]), pack_lean(lean[2]), 0.0);
}
