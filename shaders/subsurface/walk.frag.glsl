// Random walks below surfaces, from pixels through the mesh to where they leave it (lighting/walked_light.py):
//
//   each stretch of a walk leaves the object with the chance exp(-d / free path), d as far as the object goes on, and brings
//   that share of the light that enters where it would leave; what is left of the walk scatters before.
//
// So a walk is lit at each of its steps, for the one ray that a step costs. It enters as in Cycles, by the lobe of a rough
// interface, and distances are drawn for one channel, weighed for all three (balance heuristic).
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "subsurface/walks.glsl"
#include "subsurface/walked.glsl"

// Light of walks so far, per channel, and the weight with which it came.
struct Walked {
  vec3 direct;    // from points
  vec3 indirect;
  vec3 far;
  vec3 near;      // left where pixels nearby know the light
};

Walked walked_so_far;
vec3 entered_at;
vec3 entered_normal;
float pixels_range;
float points_spacing;
float translucent;
vec4 grid;
vec4 voxels;

void walk_leaves(vec3 weight, vec3 place, vec3 facing, vec2 u)
{
  ivec2 shown_at;
  float same = side_of_walk(facing, entered_normal, view_toward(place)) * (pixel_seen(place, shown_at) ? 1.0 : 0.0);
  float near = near_window(distance(place, entered_at), pixels_range) * same;
  walked_so_far.near += weight * near;
  weight *= 1.0 - near;
  walked_so_far.far += weight;
  int cell = (near < 1.0) ? cell_near(beside(place, facing, points_spacing, u.x, u.y), facing, grid, voxels) : -1;
  if (cell >= 0) {
    ivec2 texel = ivec2(cell & (ROW - 1), cell / ROW);
    vec3 entering = weight * min(cell_shapes_fetch(texel).w, translucent);
    walked_so_far.direct += entering * cell_direct_fetch(texel).rgb;
    walked_so_far.indirect += entering * cell_indirect_fetch(texel).rgb;
  }
}

#include "subsurface/walk_below.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_direct = vec4(0.0);
  out_indirect = vec4(0.0);
  out_near = vec4(0.0);
  vec4 share = scatter_share_fetch(pixel);
  int method = scatter_method(share.w);
  if (share.w < 4.0 || method == SCATTER_BURLEY) {
    return;
  }
  vec4 length_m = spread_length_fetch(pixel);
  vec3 color = unpack_three(length_m.w, 255.0);
  vec3 position = surface_position_fetch(pixel).xyz;
  vec4 normals = surface_normal_fetch(pixel);
  vec3 normal = octahedral_decode(normals.xy);
  vec3 face = octahedral_decode(normals.zw);
  int listed = first_object + OBJECT_TEXELS * (scatter_object(share.w) - 1);
  vec4 object = object_texel(listed);
  grid = object_texel(listed + 1);
  voxels = object_texel(listed + 2);
  Profile profile = profile_of(PROFILE_WALK, length_m.xyz, color);
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 229);
  int own = cell_near(beside(position, face, object.z, to_unit(roll.x), to_unit(roll.y)), face, grid, voxels);
  float depth = (own >= 0) ? cell_shapes_fetch(ivec2(own & (ROW - 1), own / ROW)).y : 1e30;
  float width = pixel_width_at(position);
  float range = window_of_walks(object, width);
  float part = walked_part(profile, object, width, depth);
  if (part <= 0.0) {
    return;
  }
  vec4 entry = scatter_walk_fetch(pixel);
  vec3 view = view_toward(position);
  vec3 start = ray_origin(position, -face);

  Below below = below_of(object.w, color, length_m.xyz);
  walked_so_far.direct = walked_so_far.indirect = walked_so_far.far = walked_so_far.near = vec3(0.0);
  entered_at = position;
  entered_normal = normal;
  pixels_range = range;
  points_spacing = object.z;
  translucent = spread_entry_fetch(pixel).w;
  vec3 rest = vec3(0.0);
  int count = walks_of_pixel(walks, most_walks, dense_walks, width, below.free_path);
  for (int walk = 0; walk < count; walk++) {
    Even even = even_of_pixel(pixel, film_view.sample_index * count + walk, 227);
    vec3 direction = entry_direction(normal, view, entry.x, entry.y, method == SCATTER_SKIN, even_entry(even));
    if (dot(direction, face) >= 0.0) {
      continue;
    }
    rest += walk_below(below, start, direction, even, roll);
  }
  // What is left leaves where others have left.
  Walked sum = walked_so_far;
  rest *= walk_rest(color);
  vec3 norm = (vec3(1.0) + rest / max(sum.near + sum.far, vec3(1e-6))) / (max(color, vec3(1e-3)) * float(count));
  out_direct = vec4(sum.direct * norm, part);
  out_indirect = vec4(sum.indirect * norm, part);
  out_near = vec4(sum.near * norm, part);
}
