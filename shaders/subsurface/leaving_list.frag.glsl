// Writes what leaves points into the list that subsurface/leaving.glsl reads, of sums over the samples so far, five texels for each:
// the mean, w: red of what leaves on the same side; the part, w: green of that; the slope as a share of the mean, w: blue of
// that; the place; how each channel leans, as a share of the mean.
#include "lib/gbuffer.glsl"
#include "subsurface/image.glsl"
#include "subsurface/lean.glsl"

#define ALIKE 0.6       // cosine between normals of points from which on directions are alike
#define AS_DIFFUSE 8.0  // walks that count as of a diffuse surface: few tell little of directions

// How what leaves depends on the direction, as a share of the mean: sums over points that face alike by sums, since a single walk that
// finds light says nothing of those that find none. Light that comes straight through leaves in one direction for all of them, so
// it is vectors that are added, `slope` along the normal and `lean` along the surface.
vec3 slope_at(ivec2 texel, out mat3 lean)
{
  vec3 normal = octahedral_decode(point_normal_fetch(texel).xy);
  vec4 whole = vec4(0.0);
  mat3 sums = mat3(0.0);
  for (int x = 0; x < ROW; x++) {
    ivec2 other = ivec2(x, texel.y);
    vec3 facing = octahedral_decode(point_normal_fetch(other).xy);
    float alike = smoothstep(ALIKE, 0.5 + 0.5 * ALIKE, dot(facing, normal));
    whole += alike * cell_sent_fetch(other);
    vec3 along = cell_slope_fetch(other).rgb;
    sums += alike * (mat3(cell_red_fetch(other).rgb, cell_green_fetch(other).rgb, cell_blue_fetch(other).rgb)
                     + mat3(along.r * facing, along.g * facing, along.b * facing));
  }
  vec3 per = vec3(whole.w / (whole.w + AS_DIFFUSE)) / max(whole.rgb, vec3(1e-20));
  vec3 slope = per * (normal * sums);
  lean = mat3(per.r * sums[0] - slope.r * normal, per.g * sums[1] - slope.g * normal, per.b * sums[2] - slope.b * normal);
  return slope;
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
  vec4 same = cell_same_fetch(texel);
  float per = 1.0 / max(same.w, 1.0);
  same *= per;
  vec3 part = per * vec3(cell_red_fetch(texel).w, cell_green_fetch(texel).w, cell_blue_fetch(texel).w);
  mat3 lean = mat3(0.0);
  vec3 slope = (kind == 2 || kind == 4) ? slope_at(texel, lean) : vec3(0.0);
  out_texel = (kind == 0) ? vec4(per * cell_sent_fetch(texel).rgb, same.r) : (kind == 1) ? vec4(part, same.g)
            : (kind == 2) ? vec4(slope, same.b) : (kind == 3) ? vec4(point_position_fetch(texel).xyz, 0.0)
            : vec4(pack_lean(lean[0]), pack_lean(lean[1]), pack_lean(lean[2]), 0.0);
}
