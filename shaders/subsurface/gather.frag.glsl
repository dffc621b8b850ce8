// Light that leaves a pixel's surface, of what entered its object elsewhere (techniques/image_space_subsurface.py):
//
//   E(x) = c_near mean of E over pixels within the window + (1 - c_near) mean of E over points of the mesh beyond it,
//
// each by the profile, per channel. Where walks take the place of this (walk.frag.glsl), the mean over pixels is an image of
// its own. `light_*` hold the radiance of the picture's pixels, albedo included; points are white.
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "subsurface/image.glsl"
#include "subsurface/lines.glsl"
#include "subsurface/profile.glsl"
#include "subsurface/walked.glsl"

#define LEAST_COLOR 1e-5  // what is darker tells nothing of the light that arrives
#define GOLDEN 2.39996323
#define LITTLE 0.01  // of the far light's share: where points bring less, pixels nearby stand in

struct Arriving {
  vec3 direct;
  vec3 indirect;
  vec3 whole;
};

// Light that arrives at a pixel over pi, per channel, weighted.
void arriving_pixel(inout Arriving sum, ivec2 pixel, float translucency, vec3 weight)
{
  vec3 albedo = surface_diffuse_fetch(pixel).rgb;
  vec3 known = step(vec3(LEAST_COLOR), albedo) * weight;
  vec4 entry = spread_entry_fetch(pixel);
  vec3 per = known / max(albedo, vec3(LEAST_COLOR)) * entry.rgb * min(entry.w, translucency);
  sum.direct += per * light_direct_fetch(pixel).rgb;
  sum.indirect += per * light_indirect_fetch(pixel).rgb;
  sum.whole += known;
}

// Mean of what arrives at pixels of the object within `extent`, by the profile in the window; taps on a spiral, denser inwards.
// `beyond`: the share of the profile that lies outside of the picture. `alike`: of those on the same side alone, by whose mean
// walks are lit that leave there; where `walked` is not 0.
Arriving near_light(ivec2 here, vec3 position, vec3 normal, Profile profile, float object, float extent, float range,
                    float pixel_size, float translucency, float walked, out vec3 beyond, out Arriving alike)
{
  Arriving sum;
  sum.direct = sum.indirect = sum.whole = vec3(0.0);
  alike = sum;
  beyond = vec3(0.0);
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  uvec3 roll = roll_of(here, film_view.sample_index, film_view.seed, 211);
  float turn = to_unit(roll.x) * 2.0 * PI;
  float shift = to_unit(roll.y);
  float inner = max(0.5 * pixel_size, 1e-3 * extent);
  float ratio = log(1.0 + extent / inner);
  for (int k = 0; k < taps; k++) {
    float r = inner * (exp((float(k) + shift) / float(taps) * ratio) - 1.0);
    float angle = turn + GOLDEN * float(k);
    ivec2 pixel;
    if (!pixel_seen(position + r * (cos(angle) * tangent + sin(angle) * bitangent), pixel)) {
      beyond += profile_radial(profile, r) * (near_window(r, range) * (r + inner));
      continue;
    }
    float away = r;
    if (any(notEqual(pixel, here))) {
      if (floor(scatter_share_fetch(pixel).w * 0.25) != object) {
        continue;
      }
      float apart = distance(surface_position_fetch(pixel).xyz, position);
      away = (abs(apart - r) < 2.0 * pixel_size) ? r : apart;
    }
    // The density of taps at r is 1 / ((r + inner) ratio).
    float weight = near_window(away, range) * (r + inner) * (r / max(away, 1e-20));
    vec3 weights = profile_radial(profile, away) * weight;
    arriving_pixel(sum, pixel, translucency, weights);
    if (walked > 0.0) {
      // A pixel shows the more of a surface the more this is turned away.
      vec3 face = octahedral_decode(surface_normal_fetch(pixel).zw);
      vec3 view = view_toward(position);
      float side = side_of_walk(face, normal, view) / max(dot(face, view), 0.05);
      arriving_pixel(alike, pixel, translucency, weights * side);
    }
  }
  beyond /= max(beyond + sum.whole, vec3(1e-20));
  return sum;
}

// Light from points of the object within reach. `whole` of what faces as the pixel does and lies beyond the window: the
// integral of the profile there. `beside`: of what lies in the window and outside of the picture. `behind`: of what faces
// away, all of it, which no pixel near stands for.
struct Far {
  Arriving ahead;
  Arriving beside;
  Arriving behind;
  float chord;  // mean length of lines through the object from here, m
  vec3 lines;   // how much of Burley's profile Cycles counts in the window, over a plane's
};

// Of points that face the other way, how much more a walk finds them than a plane's profile says, at `paths` mean free paths:
// fitted to walks in slabs and spheres (docs/subsurface.md).
vec3 walk_through(float r, vec3 free_path, vec3 absorption)
{
  vec3 paths = max(vec3(r) / free_path, vec3(0.1));
  return min(vec3(1.5) + 1.7 / paths + 2.0 * absorption * paths, vec3(12.0));
}

// Cycles finds places of Burley's profile by lines along the surface's normal and two tangents, and counts what it finds by its
// distance from x over that from the line's foot: of bent surfaces more than the profile says. What stands for 1/r then: a mean
// over the lines (1/2, 1/4, 1/4 of them, weighted by the square of each one's density).
float burley_lines(vec3 path, vec3 face, vec3 normal, vec3 tangent, vec3 bitangent, float least)
{
  vec3 density = vec3(0.5, 0.25, 0.25) * abs(vec3(dot(face, normal), dot(face, tangent), dot(face, bitangent)));
  density *= density;
  vec3 along = vec3(dot(path, normal), dot(path, tangent), dot(path, bitangent));
  float squared = dot(path, path);
  vec3 foot = sqrt(max(vec3(squared) - along * along, vec3(0.0)));
  foot = mix(foot, vec3(0.5 * least), lessThan(foot, vec3(least)));  // the mean of 1/foot over a disc
  return dot(density, vec3(1.0) / max(foot, vec3(1e-20))) / max(dot(density, vec3(1.0)), 1e-12);
}

void far_add(inout Arriving sum, ivec2 texel, float translucency, vec3 weight)
{
  sum.direct += weight * translucency * cell_direct_fetch(texel).rgb;
  sum.indirect += weight * translucency * cell_indirect_fetch(texel).rgb;
  sum.whole += weight;
}

Far far_light(vec3 position, vec3 normal, Profile profile, vec4 object, float range, int kind, vec3 free_path,
              vec3 absorption, float translucency)
{
  Far far;
  far.ahead.direct = far.ahead.indirect = far.ahead.whole = vec3(0.0);
  far.beside = far.ahead;
  far.behind = far.ahead;
  float reach = profile_reach(profile);
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  float chords = 0.0;
  float chord_weight = 0.0;
  vec3 lines = vec3(0.0);
  float lines_weight = 0.0;
  int first = int(object.x + 0.5);
  int last = first + int(object.y + 0.5);
  for (int row = first; row < last; row++) {
    vec4 bound = cells_fetch(ivec2(ROW, row));
    if (distance(bound.xyz, position) - bound.w > max(reach, 2.0 * object.z)) {
      continue;
    }
    for (int k = 0; k < ROW; k++) {
      ivec2 texel = ivec2(k, row);
      vec4 cell = cells_fetch(texel);
      float r = distance(cell.xyz, position);
      if (r < max(reach, 2.0 * object.z)) {
        vec4 shape = cell_shapes_fetch(texel);
        vec3 face = unpack_normal(shape.x);
        float facing = dot(face, normal);
        float front = smoothstep(-0.2, 0.4, facing);
        float nearness = front / (r * r + object.z * object.z);
        if (shape.z < 0.0) {
          lines += nearness * unpack_lines(shape.z);
          lines_weight += nearness;
        }
        else {
          chords += nearness * shape.z;
          chord_weight += nearness;
        }
        // Within `core` 1/r is taken for its mean over the disc around the nearest point of the face's plane.
        float core = 0.25 * object.z;
        float height = abs(dot(cell.xyz - position, face));
        float per = (r < core) ? 2.0 / (core + height) : 1.0 / r;
        if (kind == PROFILE_BURLEY) {
          per = burley_lines(cell.xyz - position, face, normal, tangent, bitangent, core);
        }
        vec3 weight = profile_radial(profile, r) * (cell.w * per / (2.0 * PI));
        far_add(far.ahead, texel, min(shape.w, translucency), weight * front * (1.0 - near_window(r, range)));
        ivec2 pixel;
        if (r < range && !pixel_seen(cell.xyz, pixel)) {
          far_add(far.beside, texel, min(shape.w, translucency), weight * front * near_window(r, range));
        }
        if (kind == PROFILE_WALK) {
          weight *= mix(vec3(1.0), walk_through(r, free_path, absorption), clamp(0.5 - 0.5 * facing, 0.0, 1.0));
        }
        far_add(far.behind, texel, min(shape.w, translucency), weight * (1.0 - front));
      }
    }
  }
  far.chord = (chord_weight > 0.0) ? chords / chord_weight : 1e30;
  far.lines = (lines_weight > 0.0) ? lines / lines_weight : vec3(1.0);
  return far;
}

// Where an object is thin against a walk's range, more of it comes out again than of a plane, to the power of this:
// `chord` in mean free paths; fitted as above.
vec3 walk_exponent(vec3 chord, vec3 absorption)
{
  vec3 x = min(0.5 * chord * absorption, vec3(20.0));
  return vec3(1.0) - exp(-x * (vec3(0.8) + 0.2 * x));
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_direct = light_direct_fetch(pixel);
  out_indirect = light_indirect_fetch(pixel);
  out_whole = whole_before_fetch(pixel);
  out_near_direct = vec4(0.0);
  out_near_indirect = vec4(0.0);
  vec4 share = scatter_share_fetch(pixel);
  if (share.w < 4.0) {
    return;
  }
  vec4 length_m = spread_length_fetch(pixel);
  vec3 position = surface_position_fetch(pixel).xyz;
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  vec3 albedo = surface_diffuse_fetch(pixel).rgb;
  vec3 color = unpack_three(length_m.w, 255.0);
  int method = scatter_method(share.w);
  int kind = (method == SCATTER_BURLEY) ? PROFILE_BURLEY : PROFILE_WALK;
  Profile profile = profile_of(kind, length_m.xyz, color);
  float width = pixel_width_at(position);
  vec3 absorption = walk_absorption(color);
  vec3 free_path = max(length_m.xyz, vec3(LEAST_SCALE));
  float chord = 1e30;

  Arriving own;
  own.direct = own.indirect = own.whole = vec3(0.0);
  float translucency = spread_entry_fetch(pixel).w;
  arriving_pixel(own, pixel, translucency, vec3(1.0));
  vec3 direct = own.direct;
  vec3 indirect = own.indirect;
  float code = floor(share.w * 0.25);
  vec4 object = object_texel(first_object + OBJECT_TEXELS * (int(code) - 1));
  float reach = profile_reach(profile);
  vec3 stays = vec3(1.0) - share.rgb * translucency;
  vec3 leaves = albedo * share.rgb;
  float walked = (points_lit != 0) ? walked_near_fetch(pixel).w : 0.0;
  if (reach > width) {  // else all of it lies within the pixel
    // Without points, or where they lie too far apart to know more than pixels do, all is taken from these.
    bool has_points = points_tell(reach, object, width, points_lit != 0);
    float window = (kind == PROFILE_WALK) ? window_of_walks(object, width) : RANGE * object.z;
    float range = has_points ? window : 1e3 * reach;
    vec3 beyond;
    Arriving alike;
    Arriving near = near_light(pixel, position, normal, profile, code, min(range, reach), range, width, translucency, walked,
                               beyond, alike);
    vec3 found = step(vec3(1e-20), near.whole);
    direct = mix(own.direct, near.direct / max(near.whole, vec3(1e-20)), found);
    indirect = mix(own.indirect, near.indirect / max(near.whole, vec3(1e-20)), found);
    vec3 known = step(vec3(1e-20), alike.whole);
    vec3 per = vec3(1.0) / max(alike.whole, vec3(1e-20));
    out_near_direct = vec4(walked * leaves * mix(own.direct, alike.direct * per, known), walked);
    out_near_indirect = vec4(walked * leaves * mix(own.indirect, alike.indirect * per, known), walked);
    if (has_points && walked < 1.0) {
      vec3 inside = profile_near(profile, range);
      vec3 outside = max(vec3(1.0) - inside, vec3(0.0));
      Far far = far_light(position, normal, profile, object, range, kind, free_path, absorption, translucency);
      chord = far.chord;
      vec3 beside = beyond * step(vec3(1e-20), far.beside.whole);
      direct = mix(direct, far.beside.direct / max(far.beside.whole, vec3(1e-20)), beside);
      indirect = mix(indirect, far.beside.indirect / max(far.beside.whole, vec3(1e-20)), beside);
      vec3 spare = LITTLE * outside + vec3(1e-12);
      vec3 whole = far.ahead.whole + spare;
      vec3 scale = outside;
      vec3 all = vec3(1.0) + far.behind.whole;
      if (kind == PROFILE_BURLEY) {
        // Cycles sums the profile over the surface as it is, thin or bent: the mean of that over the samples so far.
        out_whole += vec4(far.ahead.whole, 1.0);
        scale = min(out_whole.xyz / out_whole.w, vec3(4.0));
        inside *= far.lines;
        all = vec3(1.0);
      }
      direct = (inside * direct + scale * (far.ahead.direct + spare * direct) / whole + far.behind.direct) / all;
      indirect = (inside * indirect + scale * (far.ahead.indirect + spare * indirect) / whole + far.behind.indirect) / all;
    }
  }
  if (kind == PROFILE_WALK) {
    // What enters steeply comes out less often than the albedo says, which is for light from all sides.
    vec3 returned = walk_returned(absorption, clamp(scatter_cosine(share.w), 0.01, 1.0));
    returned = (method == SCATTER_SKIN) ? 0.5 * (returned + color) : returned;
    vec3 power = walk_exponent(vec3(chord) / free_path, absorption);
    vec3 factor = pow(clamp(returned, vec3(1e-4), vec3(1.0)), power) / max(color, vec3(1e-3));
    direct *= factor;
    indirect *= factor;
  }
  out_direct.rgb = out_direct.rgb * stays + (1.0 - walked) * leaves * direct;
  out_indirect.rgb = out_indirect.rgb * stays + (1.0 - walked) * leaves * indirect;
}
