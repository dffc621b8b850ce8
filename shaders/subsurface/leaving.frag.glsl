// What light below the surface leaves objects at their points, for whoever sees them but the camera (lighting/leaving_light.py): by
// walks from each point, entered from directions of the cosine's density. For albedo 1, added over the walks of a picture:
//
//   sent  radiance, of the direct light of points, mean over directions; w: sum of the squares of its luminance over single walks
//   slope by how much more the normal's direction gets than the surface's: the line fitted to the walks by the cosine; w: above 0
//         in glass
//   same  of light that arrives evenly at the side on which the point lies, how much leaves there again; w: walks, or
//         samples where none are walked
//   red, green, blue  lean along the surface, by how much more the direction towards it gets, of each channel; w: part, the share
//         of the diffuse albedo that scatters and that walks find; the rest is as a diffuse surface
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "subsurface/walks.glsl"
#include "subsurface/walked.glsl"

vec3 sent_so_far;
vec3 same_so_far;
vec3 left_so_far;
vec3 entered_normal;
float points_spacing;
float translucent;
vec4 grid;
vec4 voxels;

void walk_leaves(vec3 weight, vec3 place, vec3 facing, vec2 u)
{
  left_so_far += weight;
  same_so_far += weight * smoothstep(-0.2, 0.4, dot(facing, entered_normal));
  int cell = cell_near(beside(place, facing, points_spacing, u.x, u.y), facing, grid, voxels);
  if (cell >= 0) {
    ivec2 texel = ivec2(cell & (ROW - 1), cell / ROW);
    sent_so_far += weight * min(cell_shapes_fetch(texel).w, translucent) * cell_direct_fetch(texel).rgb;
  }
}

#include "subsurface/walk_below.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  out_sent = vec4(0.0);
  out_same = vec4(0.0);
  out_slope = vec4(0.0);
  out_red = vec4(0.0);
  out_green = vec4(0.0);
  out_blue = vec4(0.0);
  if ((texel.y + draw_number) % stride != 0) {
    return;
  }
  vec4 place = point_position_fetch(texel);
  vec4 belongs = point_instances_fetch(texel);
  int material = int(belongs.w + 0.5);
  int rows = scatter_means_size().y / 3;
  ivec2 at = ivec2(material & 15, material >> 4);
  vec4 length_m = scatter_means_fetch(at);
  vec4 color = scatter_means_fetch(at + ivec2(0, rows));
  vec4 share = scatter_means_fetch(at + ivec2(0, 2 * rows));
  int method = int(length_m.w + 0.5);
  vec4 coat = (in_glass != 0) ? cell_coat_fetch(texel) : vec4(1.0, 1.0, 1.0, 0.0);
  if (place.w == 0.0 || !(max_component(share.rgb) > 0.0)) {
    return;
  }
  int listed = first_object + OBJECT_TEXELS * int(belongs.x + 0.5);
  vec4 object = object_texel(listed);
  grid = object_texel(listed + 1);
  voxels = object_texel(listed + 2);
  vec4 shape = cell_shapes_fetch(texel);
  bool walks_below = method != SCATTER_BURLEY;
  float part = walks_below ? walked_part(profile_of(PROFILE_WALK, length_m.xyz, color.rgb), object, 0.0, shape.y) : 0.0;
  if (part <= 0.0) {
    // As a diffuse surface, for the light of it that glass around mirrors back.
    out_sent.rgb = coat.w * min(shape.w, 1.0) * cell_direct_fetch(texel).rgb;
    out_same = coat.w * vec4(coat.rgb, 1.0);
    out_slope.w = coat.w;
    vec3 found = coat.w * share.rgb;
    out_red.w = found.r;
    out_green.w = found.g;
    out_blue.w = found.b;
    return;
  }
  vec4 normals = point_normal_fetch(texel);
  entered_normal = octahedral_decode(normals.xy);
  vec3 face = octahedral_decode(normals.zw);
  vec3 start = ray_origin(place.xyz, -face);
  points_spacing = object.z;
  translucent = shape.w;
  sent_so_far = same_so_far = left_so_far = vec3(0.0);
  Below below = below_of(object.w, color.rgb, length_m.xyz);
  uvec3 roll = roll_of(texel, film_view.sample_index, film_view.seed, 239);
  vec3 rest = vec3(0.0);
  vec3 by_cosine = vec3(0.0);
  mat3 aslant = mat3(0.0);
  float squares = 0.0;
  for (int walk = 0; walk < walks; walk++) {
    Even even = even_alone(texel, first_walk + walk, 241);
    uvec2 salt = hash3(even.more).xy;
    vec2 v = vec2(shuffled(even.index, even.more.xy), shuffled(even.index, salt));
    vec3 view = cosine_direction(entered_normal, v);
    vec3 direction = entry_direction(entered_normal, view, color.w, share.w, method == SCATTER_SKIN, even_entry(even));
    vec3 before = sent_so_far;
    if (dot(direction, face) < 0.0) {
      rest += walk_below(below, start, direction, even, roll);
    }
    float cosine = dot(view, entered_normal);
    vec3 brought = sent_so_far - before;
    float alone = luminance(brought / max(color.rgb, vec3(1e-3)));
    squares += alone * alone;
    by_cosine += (cosine - 2.0 / 3.0) * brought;
    aslant += outerProduct(view - cosine * entered_normal, brought);
  }
  rest *= walk_rest(color.rgb);
  vec3 norm = (vec3(1.0) + rest / max(left_so_far, vec3(1e-6))) / max(color.rgb, vec3(1e-3));
  float scale = 1.0 + luminance(rest) / max(luminance(left_so_far), 1e-6);
  // In glass the rest is sent as by a diffuse surface, too.
  float rests = coat.w * (1.0 - part);
  part += rests;
  rests /= part;
  vec3 diffuse = float(walks) * min(shape.w, 1.0) * cell_direct_fetch(texel).rgb;
  scale *= 1.0 - rests;
  out_sent = vec4(mix(sent_so_far * norm, diffuse, rests), scale * scale * squares);
  // One over the variance of the cosine, and of either component along the surface.
  norm *= 1.0 - rests;
  out_slope = vec4(18.0 * by_cosine * norm, coat.w);
  vec3 found = float(walks) * part * share.rgb;
  out_red = vec4(4.0 * norm.r * aslant[0], found.r);
  out_green = vec4(4.0 * norm.g * aslant[1], found.g);
  out_blue = vec4(4.0 * norm.b * aslant[2], found.b);
  out_same = vec4((same_so_far * norm + float(walks) * vec3(rests)) * coat.rgb, float(walks));
}
