// The surface of grass: from where the view's ray enters the plane on top, to the blade that it meets there.
// Musawir Shah, "Image-space approach to real-time realistic rendering" (2007), chapter 4. Changed: of the four views around a
// direction each sample takes one, with the probability of its weight, and one texel of the four around a place; so colour
// and depth are of one blade, and the mean over samples is the interpolation. Contrast and parallax: docs/grass.md.
#include "grass/table.glsl"

#ifndef GRASS_SAMPLE
#define GRASS_SAMPLE film_view.sample_index
#define GRASS_SEED film_view.seed
#endif

#define GRASS_STEPS 12.0    // of a ray down to blades that a map makes lower
#define GRASS_LOWEST 0.02  // of the height: below it no blades stand

struct OwnHit {
  bool bare;       // no blade stands here: the material's own surface shows
  float place;     // of the patch's table
  float contrast;
  vec3 along_x;    // on the surface: how a step changes the place in the tile, as the tile that was rendered would have it
  vec3 along_y;
  vec3 albedo;
};

// A number of this sample and pixel, stratified over the samples.
float grass_roll(int purpose)
{
  uvec2 salt = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(purpose) + uint(GRASS_SEED) * 64u)).xy;
  return shuffled(GRASS_SAMPLE, salt);
}

float grass_cell(ivec2 cell)
{
  return to_unit(hash3(uvec3(uvec2(cell + ivec2(1 << 20)), 77u)).x);
}

// Smooth noise whose values are about even from 0 to 1: clumps.
float grass_clumps(vec2 place)
{
  vec2 low = floor(place);
  vec2 f = place - low;
  f = f * f * (3.0 - 2.0 * f);
  ivec2 cell = ivec2(low);
  float below = mix(grass_cell(cell), grass_cell(cell + ivec2(1, 0)), f.x);
  float above = mix(grass_cell(cell + ivec2(0, 1)), grass_cell(cell + ivec2(1, 1)), f.x);
  return smoothstep(0.15, 0.85, mix(below, above, f.y));
}

// How far along its ray a point lies that is `below` the plane on top, where that bends upwards by `bend` per metre.
float grass_length(float below, float rise, float bend)
{
  return 2.0 * below / (rise + sqrt(rise * rise + 2.0 * bend * below));
}

// The same in a hollow of flat triangles. Normals that are interpolated between unit ones by t have the square 1 - t (1 - t) a^2,
// where a is the angle between the normals, and lean from the triangle's own by a (t - 1/2): so both tell a, and how far ahead
// the next triangle rises by that angle.
float grass_folded(float sunk, float facing, SurfacePoint point, float curvature, vec3 ahead)
{
  float shorter = instance_shares_mesh(instance_flat.x) ? 0.0 : max(1.0 - dot(world_normal, world_normal), 0.0);
  float lean = dot(point.normal, ahead) - dot(point.geometric_normal, ahead);
  float half_fold = sqrt(shorter + lean * lean);
  float level = sqrt(max(1.0 - facing * facing, 1e-6));
  float edge = max(half_fold - lean, 0.0) / (curvature * level);
  float fold = min(2.0 * half_fold, 1.5);
  float risen = facing * cos(fold) + level * sin(fold);
  return (sunk <= edge * facing) ? sunk / facing : edge + (sunk - edge * facing) / max(risen, facing);
}

// Repeats show where the same tile lies beside itself. A triangular lattice has a shift of the tile at each of its vertices,
// and a place takes one of the three around it, with a probability that falls fast with the distance (the lattice of Heitz &
// Neyret, "High-Performance By-Example Noise using a Histogram-Preserving Blending Operator", 2018). `squares`: the sum of
// squared probabilities.
vec2 grass_variation(vec2 place, float roll, out float squares)
{
  const float scale = 1.5;  // edges of the lattice in a tile, about
  const float sharpness = 4.0;
  vec2 skewed = scale * vec2(place.x - 0.57735027 * place.y, 1.15470054 * place.y);
  ivec2 base = ivec2(floor(skewed));
  vec2 f = skewed - floor(skewed);
  float rest = 1.0 - f.x - f.y;
  bool lower = rest > 0.0;
  vec3 weight = lower ? vec3(rest, f.y, f.x) : vec3(-rest, 1.0 - f.y, 1.0 - f.x);
  weight = pow(max(weight, vec3(1e-4)), vec3(sharpness));
  weight /= weight.x + weight.y + weight.z;
  squares = dot(weight, weight);
  ivec2 first = base + (lower ? ivec2(0) : ivec2(1));
  ivec2 second = base + (lower ? ivec2(0, 1) : ivec2(1, 0));
  ivec2 third = base + (lower ? ivec2(1, 0) : ivec2(0, 1));
  ivec2 corner = (roll < weight.x) ? first : ((roll < weight.x + weight.y) ? second : third);
  uvec3 bits = hash3(uvec3(uvec2(corner + ivec2(1 << 20)), 91u));
  return vec2(to_unit(bits.x), to_unit(bits.y));
}

// How the place in tiles changes along the surface, per metre. Where a UV map places tiles these are the gradients of its
// coordinates; they say how the map lies, how large it is, whether it is mirrored and sheared. Without a map, or where it has no
// area, the object's axes place them.
vec2 grass_tiles(Grass g, SurfacePoint point, Instance instance, vec3 up, out vec3 along_x, out vec3 along_y)
{
#ifdef GRASS_UV
  if (g.tiles > 0.0) {
    float width = length(point.position_dx);
    vec2 change_x = point.attributes_dx[GRASS_UV].xy;
    vec2 change_y = point.attributes_dy[GRASS_UV].xy;
    float area = abs(change_x.x * change_y.y - change_x.y * change_y.x);
    if (area > 1e-6 * (dot(change_x, change_x) + dot(change_y, change_y)) && width > 0.0) {
      float scale = g.tiles / (width * width);
      along_x = scale * (change_x.x * point.position_dx + change_y.x * point.position_dy);
      along_y = scale * (change_x.y * point.position_dx + change_y.y * point.position_dy);
      along_x -= up * dot(along_x, up);
      along_y -= up * dot(along_y, up);
      return g.tiles * point.attributes[GRASS_UV].xy;
    }
  }
#endif
  vec3 axis_x = safe_normalize(vec3(instance.row0.x, instance.row1.x, instance.row2.x));
  vec3 axis_y = safe_normalize(vec3(instance.row0.y, instance.row1.y, instance.row2.y));
  along_x = safe_normalize(axis_x - up * dot(axis_x, up)) / g.size;
  along_y = cross(up, along_x);
  vec3 from = point.position - instance_origin(instance);
  return vec2(dot(from, axis_x), dot(from, axis_y)) / g.size;
}

bool own_hit(inout SurfacePoint point, Instance instance, out OwnHit hit)
{
  hit.bare = true;
  hit.place = 0.0;
  hit.contrast = 1.0;
  hit.along_x = vec3(1.0, 0.0, 0.0);
  hit.along_y = vec3(0.0, 1.0, 0.0);
  hit.albedo = vec3(0.0);
  // Taken before any pixel of four leaves, for they are differences to its neighbours.
  vec3 place_along_x = dFdx(world_position);
  vec3 place_along_y = dFdy(world_position);
  vec3 normal_along_x = dFdx(world_normal);
  vec3 normal_along_y = dFdy(world_normal);
  Grass g = grass_of(grass_entry);
  vec3 up = point.normal;
  vec3 toward = point.incoming;
  float rise = dot(toward, up);
  if (rise <= 0.0 || point.backfacing) {
    return false;  // from below
  }
  rise = max(rise, 0.02);
  vec3 along_x;
  vec3 along_y;
  vec2 uv = grass_tiles(g, point, instance, up, along_x, along_y);
  vec2 ground = vec2(dot(toward, along_x), dot(toward, along_y));
  float size = inversesqrt(max(length(cross(along_x, along_y)), 1e-20));  // of the tile here, m

  // Where a map makes blades lower the ray goes on to their tips.
  float height = g.height;
  float lead = 0.0;
  if (grass_texel(g.entry + GRASS_HEIGHT_MAP).w > 0.0) {
    float step = g.height / (rise * GRASS_STEPS);
    float over = 1.0 - grass_map(g, GRASS_HEIGHT_MAP, uv);
    for (int k = 1; k <= int(GRASS_STEPS) && over > 0.0; k++) {
      float before = over;
      over = 1.0 - float(k) / GRASS_STEPS - grass_map(g, GRASS_HEIGHT_MAP, uv - step * float(k) * ground);
      lead = step * (float(k) - ((over > 0.0) ? 0.0 : over / min(over - before, -1e-6)));
    }
    height = max(g.height - lead * rise, 0.0);
    uv -= lead * ground;
  }
  hit.along_x = along_x * (height / g.slope);
  hit.along_y = along_y * (height / g.slope);
  vec3 view = grass_in_tile(g, ground, rise, height);

  vec4 low;
  vec4 high;
  float outer = grass_rings(g.entry + GRASS_VIEW_RINGS, g.view_rings, view, low, high);
  vec3 inside = grass_azimuths(low, view);
  vec3 outside = grass_azimuths(high, view);
  bool outward = grass_roll(51) < outer;
  vec3 chosen = outward ? outside : inside;
  vec4 ring = outward ? high : low;
  float number = (grass_roll(52) < chosen.z) ? chosen.y : chosen.x;

  // The picture of that view is moved so that what is at its mean height stays where it is.
  vec3 taken = grass_ring_direction(ring, number);
  vec3 seen = view;
  float steepest = cos(radians(grass_texel(g.entry + GRASS_VIEW_RINGS + g.view_rings - 1).x));
  if (seen.z < steepest) {
    seen = vec3(safe_normalize(vec3(seen.xy, 0.0)).xy * sqrt(1.0 - steepest * steepest), steepest);
  }
  vec2 aside = (1.0 - ring.w) * g.slope * (taken.xy / taken.z - seen.xy / seen.z);
  float tile_squares = 1.0;
  if (grass_texel(g.entry + GRASS_VARIED).x > 0.5) {
    // By where the blades' mean height is seen, which stays as the view moves.
    aside += grass_variation(uv - (1.0 - ring.w) * g.slope * seen.xy / seen.z, grass_roll(55), tile_squares);
  }
  // Between texels that are larger than pixels one is drawn as bilinear interpolation weighs them; smaller ones the pixel's
  // own filter mixes.
  float tile_pixels = size * sqrt(rise) / max(pixel_width(world_position), 1e-20);
  float spread = smoothstep(0.75, 1.5, tile_pixels / float(g.side));
  vec2 texel = (uv + aside) * float(g.side) + spread * (vec2(grass_roll(53), grass_roll(54)) - 0.5);
  ivec2 wrapped = ivec2(floor(fract(texel / float(g.side)) * float(g.side)));
  wrapped = clamp(wrapped, ivec2(0), ivec2(g.side - 1));
  int picture = int(number + 0.5);
  int place = (picture * g.side + wrapped.y) * g.side + wrapped.x;
  GrassPlace shown = grass_place(g, place);
  float below = (1.0 - clamp(shown.mean.w, 0.0, 1.0)) * height;

  // On a crest the ground falls away from the ray, which climbs out of the grass again if it has met fewer blades by then than
  // the picture's ray had when it met this one. How many stand in the way grows as the square of how far below the tips.
  vec3 ahead = safe_normalize(toward - up * dot(toward, up));
  vec2 steps = steps_along(ahead, point.geometric_normal, place_along_x, place_along_y);
  vec3 bend = steps.x * normal_along_x + steps.y * normal_along_y;
  float curvature = dot(bend, ahead) / max(length(world_normal), 1e-20);
  float level = max(1.0 - rise * rise, 1e-6);
  float falling = curvature * level * height;
  if (falling > 0.0 && rise * rise < 2.0 * falling) {
    // All rays above one place of the crest ask for what stands there, so that what covers one of them covers those below.
    vec2 crown = (rise / (curvature * level)) * ground;
    ivec2 cell = ivec2(fract(texel / float(g.side) - crown) * float(g.side));
    cell = clamp(cell, ivec2(0), ivec2(g.side - 1));
    int there = grass_places(g) + GRASS_PLACE * ((picture * g.side + cell.y) * g.side + cell.x);
    float part = 1.0 - clamp(grass_texel(there).w, 0.0, 1.0);
    float taller = height / (size * g.slope);
    float slope = taken.z * taller / length(vec3(taken.xy, taken.z * taller));
    float steep = rise * rise / falling;
    if (part * part * part > 0.8 * slope * steep * steep * rise / falling) {
      return false;
    }
  }

  // In a hollow the ground rises ahead, and the ray meets what stands there sooner than on flat ground.
  float bend_down = max(-curvature, 0.0) * level;
  vec2 root = uv - grass_length(below, rise, bend_down) * ground;
  float density = g.density * grass_map(g, GRASS_MAP, root);
  hit.bare = height < GRASS_LOWEST * g.height || (density < 1.0 && grass_clumps(root * 6.0) >= density);
  float depth = lead + grass_length(hit.bare ? height : below, rise, bend_down);
  // Down to the triangle itself, which is flat: what lay below it would be in its shadow. In a hollow the next triangle rises from
  // the edge ahead.
  float reach = instance_shares_mesh(instance_flat.x) ? 1.0 : length(world_normal);
  float facing = max(dot(toward, point.geometric_normal), 0.02);
  float sunk = (lead * rise + (hit.bare ? height : below)) * reach * dot(up, point.geometric_normal);
  depth = (bend_down > 0.0) ? min(depth, grass_folded(sunk, facing, point, -curvature, ahead)) : sunk / facing;
  point.position -= toward * depth;
  // Where a tile is smaller than a few pixels its mean is all that can be seen.
  vec4 about = grass_texel(grass_picture(g, picture, g.lights + 1));
  float texels = float(g.side) * sqrt(rise) / max(tile_pixels, 1e-6);  // that a pixel is wide
  float alike = mix(about.x, about.w, clamp(0.5 * log2(0.5 * texels), 0.0, 1.0));
  float contrast = grass_contrast(grass_squares(outer, inside.z, outside.z), alike) * inversesqrt(tile_squares);
  hit.contrast = contrast * smoothstep(0.5, 2.0, tile_pixels);
  hit.place = float(place);
  hit.albedo = grass_decoded(g, shown, picture, g.lights, hit.contrast);
  if (!hit.bare) {
    point.normal = up;
    point.geometric_normal = up;
    point.mesh_normal = up;
  }
  return true;
}

#ifndef CASTS_WHOLE
void own_closures(inout Closures c, SurfacePoint point, OwnHit hit)
{
  if (!hit.bare) {
    c = closures_begin(point.normal, 0.5, 0.0);
    c.diffuse = hit.albedo;
    c.diffuse_weight = 1.0;
    closures_end(c);
  }
}

// What grass/light.glsl reads instead of a lobe.
void own_store(SurfacePoint point, OwnHit hit)
{
  if (!hit.bare) {
    vec3 tangent;
    vec3 bitangent;
    orthonormal_basis(point.normal, tangent, bitangent);
    float axes = grass_pack(vec2(dot(hit.along_x, tangent), dot(hit.along_x, bitangent)));
    vec2 other = vec2(dot(hit.along_y, tangent), dot(hit.along_y, bitangent));
    out_tint = vec4(0.0, 0.0, 0.0, axes);
    out_lobe = vec4(hit.place, grass_pack(other), float(SURFACE_GRASS) * 2097152.0 + float(grass_entry), hit.contrast);
    out_emission = vec4(0.0, 0.0, 0.0, 1.0);
  }
}
#endif
