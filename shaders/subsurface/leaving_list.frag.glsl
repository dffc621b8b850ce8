// Writes what leaves points into the list that subsurface/leaving.glsl reads, of sums over the samples so far, five texels for each:
// the mean, w: red of the part; what leaves on the same side, w: green of that; the slope as a share of the mean, w: blue of that;
// the place, w: above 0 in glass; how each channel leans, as a share of the mean.
//
// Mean and same are also means over points around, since walks of one point are few, and rays that look from a mirror or through
// glass see the same points in every sample: what those err by would show as blotches. A walk is of one channel more than of others,
// so that colours err by more than brightness does, and eyes see their blotches first: colours are of wider means.
#include "lib/gbuffer.glsl"
#include "subsurface/image.glsl"
#include "subsurface/lean.glsl"
#include "subsurface/objects.glsl"

#define ALIKE 0.6       // cosine between normals of points from which on directions are alike
#define AS_DIFFUSE 8.0  // walks that count as of a diffuse surface: few tell little of directions, as do many of which few find light
#define PATHS 0.7       // free paths, and
#define SPACINGS 1.0    // distances between points at least: standard deviation of the means' weights, of few walks
#define FEW_WALKS 8.0   // above these less, by the fourth root of their number (as of pixels, subsurface/smooth.frag.glsl)
#define FARTHEST 2.5    // standard deviations
#define COLORS 2.5      // times as wide are means of colours, up to
#define COLORS_FARTHEST 1.5  // of their standard deviations

float alike_facing(vec3 facing, vec3 normal)
{
  return smoothstep(ALIKE, 0.5 + 0.5 * ALIKE, dot(facing, normal));
}

// As bright as `narrow`, of the colour of `wide`.
vec3 recolored(vec3 narrow, vec3 wide)
{
  float bright = luminance(wide);
  return (bright > 0.0) ? luminance(narrow) / bright * wide : narrow;
}

// What leaves a point of direct light, and in `same` how much of what arrives evenly on its side: means over points of the object around.
vec3 sent_around(ivec2 texel, out vec3 same)
{
  vec4 own = cell_same_fetch(texel);
  vec4 sent = cell_sent_fetch(texel);
  float per = 1.0 / max(own.w, 1.0);
  same = per * own.rgb;
  vec4 belongs = point_instances_fetch(texel);
  int material = int(belongs.w + 0.5);
  vec4 length_m = scatter_means_fetch(ivec2(material & 15, material >> 4));
  if (own.w <= 0.0 || int(length_m.w + 0.5) == SCATTER_BURLEY) {
    return per * sent.rgb;
  }
  vec4 object = object_texel(first_object + OBJECT_TEXELS * int(belongs.x + 0.5));
  vec3 place = point_position_fetch(texel).xyz;
  vec3 normal = octahedral_decode(point_normal_fetch(texel).xy);
  float many = sqrt(sqrt(max(own.w / FEW_WALKS, 1.0)));
  vec3 wide = max(PATHS * length_m.xyz / many, vec3(SPACINGS * object.z / many));
  vec3 narrower = vec3(0.5) / (wide * wide);
  float reach = FARTHEST * max_component(wide);
  float colors_reach = COLORS * COLORS_FARTHEST * max_component(wide);
  vec3 sums = vec3(0.0);
  vec3 whole = vec3(0.0);
  vec3 sums_of_colors = vec3(0.0);
  vec3 whole_of_colors = vec3(0.0);
  vec3 same_of_colors = vec3(0.0);
  same = vec3(0.0);
  int first = int(object.x + 0.5);
  for (int row = first; row < first + int(object.y + 0.5); row++) {
    vec4 bound = cells_fetch(ivec2(ROW, row));
    if (distance(bound.xyz, place) > bound.w + colors_reach) {
      continue;
    }
    for (int x = 0; x < ROW; x++) {
      ivec2 other = ivec2(x, row);
      vec3 path = point_position_fetch(other).xyz - place;
      float squared = dot(path, path);
      if (squared < colors_reach * colors_reach) {
        vec3 facing = octahedral_decode(point_normal_fetch(other).xy);
        float alike = alike_facing(facing, normal) * step(abs(point_instances_fetch(other).w - belongs.w), 0.5);
        vec4 found = cell_same_fetch(other);
        vec3 leaves = cell_sent_fetch(other).rgb;
        vec3 weight = alike * exp(-squared / (COLORS * COLORS) * narrower);
        sums_of_colors += weight * leaves;
        same_of_colors += weight * found.rgb;
        whole_of_colors += weight * found.w;
        weight = (squared < reach * reach) ? alike * exp(-squared * narrower) : vec3(0.0);
        sums += weight * leaves;
        same += weight * found.rgb;
        whole += weight * found.w;
      }
    }
  }
  whole = max(whole, vec3(1e-20));
  whole_of_colors = max(whole_of_colors, vec3(1e-20));
  same = recolored(same / whole, same_of_colors / whole_of_colors);
  return recolored(sums / whole, sums_of_colors / whole_of_colors);
}

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
    float alike = alike_facing(facing, normal);
    whole += alike * cell_sent_fetch(other);
    vec3 along = cell_slope_fetch(other).rgb;
    sums += alike * (mat3(cell_red_fetch(other).rgb, cell_green_fetch(other).rgb, cell_blue_fetch(other).rgb)
                     + mat3(along.r * facing, along.g * facing, along.b * facing));
  }
  float found = luminance(whole.rgb) * luminance(whole.rgb) / max(whole.w, 1e-20);  // so many walks of the same light each
  vec3 per = vec3(found / (found + AS_DIFFUSE)) / max(whole.rgb, vec3(1e-20));
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
  float per = 1.0 / max(cell_same_fetch(texel).w, 1.0);
  vec3 part = per * vec3(cell_red_fetch(texel).w, cell_green_fetch(texel).w, cell_blue_fetch(texel).w);
  vec3 same = vec3(0.0);
  vec3 sent = (kind < 2) ? sent_around(texel, same) : vec3(0.0);
  mat3 lean = mat3(0.0);
  vec3 slope = (kind == 2 || kind == 4) ? slope_at(texel, lean) : vec3(0.0);
  out_texel = (kind == 0) ? vec4(sent, part.r) : (kind == 1) ? vec4(same, part.g)
            : (kind == 2) ? vec4(slope, part.b) : (kind == 3) ? vec4(point_position_fetch(texel).xyz, cell_slope_fetch(texel).w)
            : vec4(pack_lean(lean[0]), pack_lean(lean[1]), pack_lean(lean[2]), 0.0);
}
