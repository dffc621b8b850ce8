// Random walks below surfaces, from pixels through the mesh to where they leave it (lighting/walked_light.py):
//
//   each stretch of a walk leaves the object with the chance exp(-d / free path), d as far as the object goes on, and brings
//   that share of the light that enters where it would leave; what is left of the walk scatters before.
//
// So a walk is lit at each of its steps, for the one ray that a step costs. It enters as in Cycles, by the lobe of a rough
// interface, and distances are drawn for one channel, weighed for all three (balance heuristic).
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "trace/rays.glsl"
#include "subsurface/image.glsl"
#include "subsurface/profile.glsl"
#include "subsurface/walked.glsl"

#define STEPS 64       // of a walk; what is left then leaves where the walk has left so far
#define FIRST_CHANCE 3 // steps before chance ends walks
#define FARTHEST 12.0  // free paths that a ray looks ahead
#define SPREAD 0.7     // distances between points, over which their light is spread
#define LAYERS 4       // surfaces of other objects that a ray passes

// Half vector of a rough interface as seen from `view`, in the frame of its normal (Heitz 2018).
vec3 facet_seen(vec3 view, float alpha, vec2 u)
{
  vec3 v = normalize(vec3(alpha * view.xy, view.z));
  float squared = dot(v.xy, v.xy);
  vec3 t = (squared > 1e-12) ? vec3(-v.y, v.x, 0.0) * inversesqrt(squared) : vec3(1.0, 0.0, 0.0);
  vec3 b = cross(v, t);
  float r = sqrt(u.x);
  float angle = 2.0 * PI * u.y;
  float x = r * cos(angle);
  float y = mix(sqrt(max(1.0 - x * x, 0.0)), r * sin(angle), 0.5 * (1.0 + v.z));
  vec3 n = x * t + y * b + sqrt(max(1.0 - x * x - y * y, 0.0)) * v;
  return normalize(vec3(alpha * n.xy, max(n.z, 1e-6)));
}

// Where a walk goes on from the view's ray: half of those of the method for skin by the cosine, all others refracted.
vec3 entry_direction(vec3 normal, vec3 view, float alpha, float ior, bool skin, vec2 u)
{
  if (skin) {
    bool even = u.x < 0.5;
    u.x = even ? 2.0 * u.x : 2.0 * u.x - 1.0;
    if (even) {
      return cosine_direction(-normal, u);
    }
    alpha = 1.0;
  }
  vec3 t;
  vec3 b;
  orthonormal_basis(normal, t, b);
  vec3 local = vec3(dot(view, t), dot(view, b), max(dot(view, normal), 1e-4));
  vec3 h = facet_seen(local, alpha, u);
  vec3 facet = h.x * t + h.y * b + h.z * normal;
  float c = dot(facet, view);
  float eta = 1.0 / ior;
  return normalize((eta * c - sqrt(max(1.0 - eta * eta * (1.0 - c * c), 0.0))) * facet - eta * view);
}

vec4 owner_texel(int index)
{
  return trace_owners_fetch(ivec2(index & 2047, index >> 11));
}

// Distance to the surface of the instance, or `limit`; what else stands in the way is passed.
float own_surface(vec3 origin, vec3 direction, float limit, float instance, uint salt, out ivec2 hit)
{
  float begun = 0.0;
  for (int k = 0; k < LAYERS; k++) {
    float t = trace_nearest(origin + begun * direction, direction, limit - begun, salt, hit);
    if (begun + t >= limit) {
      return limit;
    }
    float row = owner_texel((hit.x - first_leaf) * 4 + HIT_SLOT(hit)).x;
#ifdef INSTANCED
    if (HIT_RECORD(hit) != 0) {
      row = owner_texel(int(node_texel(HIT_RECORD(hit) * NODE_TEXELS + 3).y)).x;
    }
#endif
    begun += t;
    if (row == instance) {
      return begun;
    }
    begun += ray_offset(origin);
  }
  return limit;
}

// The cell near a place that faces along `facing`; -1 where there is none.
int cell_near(vec3 place, vec3 facing, vec4 grid, vec4 voxels)
{
  vec3 along = abs(facing);
  int axis = (along.x >= max(along.y, along.z)) ? 0 : (along.y >= along.z) ? 1 : 2;
  int number = 2 * axis + ((facing[axis] < 0.0) ? 1 : 0);
  ivec3 at = clamp(ivec3(floor((place - grid.xyz) / grid.w)), ivec3(0), ivec3(voxels.xyz) - 1);
  int index = int(voxels.w) + 2 * ((at.x * int(voxels.y) + at.y) * int(voxels.z) + at.z) + number / 3;
  return int(scatter_near_fetch(ivec2(index & 2047, index >> 11))[number % 3] + 0.5) - 1;
}

// A place on the tangent plane nearby, so that what cells have runs into each other.
vec3 beside(vec3 place, vec3 normal, float spacing, float u, float v)
{
  vec3 t;
  vec3 b;
  orthonormal_basis(normal, t, b);
  return place + SPREAD * spacing * sqrt(u) * (cos(2.0 * PI * v) * t + sin(2.0 * PI * v) * b);
}

// Light of walks so far, per channel, and the weight with which it came.
struct Walked {
  vec3 direct;    // from points
  vec3 indirect;
  vec3 far;
  vec3 near;      // left where pixels nearby know the light
};

void leave(inout Walked sum, vec3 weight, vec3 place, vec3 facing, vec3 position, vec3 normal, float range,
           float spacing, float translucency, vec4 grid, vec4 voxels, vec2 u)
{
  ivec2 shown_at;
  float same = smoothstep(0.4, 0.9, dot(facing, normal)) * (pixel_seen(place, shown_at) ? 1.0 : 0.0);
  float near = near_window(distance(place, position), range) * same;
  sum.near += weight * near;
  weight *= 1.0 - near;
  sum.far += weight;
  int cell = (near < 1.0) ? cell_near(beside(place, facing, spacing, u.x, u.y), facing, grid, voxels) : -1;
  if (cell >= 0) {
    ivec2 texel = ivec2(cell & (ROW - 1), cell / ROW);
    vec3 entering = weight * min(cell_shapes_fetch(texel).w, translucency);
    sum.direct += entering * cell_direct_fetch(texel).rgb;
    sum.indirect += entering * cell_indirect_fetch(texel).rgb;
  }
}

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
  vec4 grid = object_texel(listed + 1);
  vec4 voxels = object_texel(listed + 2);
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
  float translucency = spread_entry_fetch(pixel).w;
  vec4 entry = scatter_walk_fetch(pixel);
  vec3 view = (film_view.eye.w > 0.5) ? film_view.backward.xyz : normalize(film_view.eye.xyz - position);
  vec3 s = walk_absorption(color);
  vec3 albedo = vec3(1.0) - s * s;
  vec3 free_path = max(length_m.xyz, vec3(LEAST_SCALE));
  vec3 per = vec3(1.0) / free_path;
  float limit = FARTHEST * max_component(free_path);
  vec3 start = ray_origin(position, -face);

  Walked sum;
  sum.direct = sum.indirect = sum.far = sum.near = vec3(0.0);
  // Pixels of a block of four by four share a sequence, so that their mean is as even as that of one pixel's walks.
  uvec3 salt1 = roll_of(pixel >> 2, 0, film_view.seed, 227);
  uvec3 salt2 = hash3(salt1);
  uvec3 salt3 = hash3(salt2);
  uvec3 salt4 = hash3(salt3);
  uvec3 salt5 = hash3(salt4);
  int in_block = (pixel.x & 3) + 4 * (pixel.y & 3);
  vec3 rest = vec3(0.0);
  for (int walk = 0; walk < walks; walk++) {
    int index = (film_view.sample_index * walks + walk) * 16 + in_block;
    vec2 u = vec2(shuffled(index, salt1.xy), shuffled(index, salt2.xy));
    vec3 direction = entry_direction(normal, view, entry.x, entry.y, method == SCATTER_SKIN, u);
    if (dot(direction, face) >= 0.0) {
      continue;
    }
    vec3 origin = start;
    vec3 through = vec3(1.0);
    for (int step = 0; step < STEPS; step++) {
      roll = hash3(roll);
      ivec2 hit;
      float d = own_surface(origin, direction, limit, object.w, roll.z, hit);
      vec3 passed = (d < limit) ? exp(-d * per) : vec3(0.0);
      if (d < limit) {
        uvec3 moved = hash3(roll ^ uvec3(0x9E3779B9u));
        vec3 facing = triangle_normal(hit);
        facing = (dot(facing, direction) < 0.0) ? -facing : facing;
        leave(sum, through * passed, origin + d * direction, facing, position, normal, range, object.z, translucency, grid, voxels,
              vec2(to_unit(moved.x), to_unit(moved.y)));
      }
      vec3 chance = through * albedo * (vec3(1.0) - passed);
      float whole = chance.x + chance.y + chance.z;
      if (!(whole > 1e-6)) {
        through = vec3(0.0);
        break;
      }
      chance /= whole;
      float pick = to_unit(roll.x);
      int channel = (pick < chance.x) ? 0 : (pick < chance.x + chance.y) ? 1 : 2;
      float v = (step == 0) ? shuffled(index, salt3.xy) : to_unit(roll.y);
      float t = -free_path[channel] * log(max(1.0 - v * (1.0 - passed[channel]), 1e-7));
      t = min(t, d);
      vec3 density = per * exp(-t * per);
      through *= albedo * density / max(dot(chance, density / max(vec3(1.0) - passed, vec3(1e-9))), 1e-30);
      origin += t * direction;
      if (step >= FIRST_CHANCE) {
        float stays = min(max_component(through), 1.0);
        if (to_unit(hash3(roll ^ uvec3(0x85EBCA6Bu)).x) >= stays) {
          through = vec3(0.0);
          break;
        }
        through /= stays;
      }
      roll = hash3(roll);
      float z = 1.0 - 2.0 * ((step == 0) ? shuffled(index, salt4.xy) : to_unit(roll.x));
      float angle = 2.0 * PI * ((step == 0) ? shuffled(index, salt5.xy) : to_unit(roll.y));
      direction = vec3(sqrt(max(1.0 - z * z, 0.0)) * vec2(cos(angle), sin(angle)), z);
    }
    rest += through;
  }
  // Of what has not left after so many steps the share that diffusion brings out from where it then is, sqrt(2 STEPS / 3) free
  // paths deep, leaves where others have left.
  rest *= exp(-sqrt(2.0 * float(STEPS)) * s);
  vec3 norm = (vec3(1.0) + rest / max(sum.near + sum.far, vec3(1e-6))) / (max(color, vec3(1e-3)) * float(walks));
  out_direct = vec4(sum.direct * norm, part);
  out_indirect = vec4(sum.indirect * norm, part);
  out_near = vec4(sum.near * norm, part);
}
