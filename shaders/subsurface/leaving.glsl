// What light below their surfaces leaves objects where rays meet them, in place of what a diffuse surface would send: of the nearest
// point of an object that scatters (lighting/leaving_light.py). `leaving_light` is a list, 2048 to a row: where instances begin,
// how many there are, where voxels begin; from the next texel on which materials scatter, four to a texel; from the next row on
// five texels a point (subsurface/leaving_list.frag.glsl); instances, two each; voxels, two each (scatter_points.py).
#include "subsurface/lean.glsl"

#define MEAN_COSINE_SENT (2.0 / 3.0)
#define LEAVING_SPREAD 0.9  // voxels, over which what points send is spread

vec4 leaving_texel(int index)
{
  return leaving_light_fetch(ivec2(index & 2047, index >> 11));
}

// Light at `position` of a surface that faces along `normal`; material -1: of any. For albedo 1: `sent`, the radiance that leaves
// towards the viewer of direct light; `part`, the share of the diffuse albedo that this takes the place of; `same`, by how much of
// its albedo that part sends back light that arrives evenly on this side; `in_glass`: `sent` and `same` count all that glass
// around mirrors back (coat.frag.glsl), so that rays bring none of it. False where nothing scatters.
bool light_leaves(int material, vec3 position, vec3 normal, vec3 to_viewer, uint salt, out vec3 sent, out vec3 part,
                  out vec3 same, out bool in_glass)
{
  sent = part = same = vec3(0.0);
  in_glass = false;
  if (material >= 0 && leaving_texel(1 + (material >> 2))[material & 3] == 0.0) {
    return false;
  }
  vec4 head = leaving_texel(0);
  uvec3 roll = hash3(uvec3(salt, floatBitsToUint(position.x), floatBitsToUint(position.y)));
  vec3 t;
  vec3 b;
  orthonormal_basis(normal, t, b);
  float angle = 2.0 * PI * to_unit(roll.x);
  vec3 moved = sqrt(to_unit(roll.y)) * (cos(angle) * t + sin(angle) * b);
  vec3 along = abs(normal);
  int axis = (along.x >= max(along.y, along.z)) ? 0 : (along.y >= along.z) ? 1 : 2;
  int number = 2 * axis + ((normal[axis] < 0.0) ? 1 : 0);
  float least = 1e30;
  int chosen = -1;
  for (int k = 0; k < int(head.y); k++) {
    vec4 grid = leaving_texel(int(head.x) + 2 * k);
    vec4 voxels = leaving_texel(int(head.x) + 2 * k + 1);
    ivec3 own = ivec3(floor((position - grid.xyz) / grid.w));
    if (any(lessThan(own, ivec3(0))) || any(greaterThanEqual(own, ivec3(voxels.xyz)))) {
      continue;
    }
    ivec3 at = clamp(ivec3(floor((position + LEAVING_SPREAD * grid.w * moved - grid.xyz) / grid.w)), ivec3(0), ivec3(voxels.xyz) - 1);
    int index = int(head.z) + int(voxels.w) + 2 * ((at.x * int(voxels.y) + at.y) * int(voxels.z) + at.z) + number / 3;
    int cell = int(leaving_texel(index)[number % 3] + 0.5) - 1;
    if (cell >= 0) {
      vec4 place = leaving_texel(2048 + 5 * cell + 3);
      vec3 path = place.xyz - position;
      float away = length(path) / grid.w + 4.0 * abs(dot(path, normal)) / grid.w;
      if (away < least && length(path) < 5.0 * grid.w && (material >= 0 || abs(dot(path, normal)) < grid.w)) {
        least = away;
        chosen = cell;
        in_glass = place.w > 0.0;
      }
    }
  }
  if (chosen < 0) {
    return false;
  }
  int first = 2048 + 5 * chosen;
  vec4 mean = leaving_texel(first);
  vec4 on_same = leaving_texel(first + 1);
  vec4 slope = leaving_texel(first + 2);
  part = vec3(mean.w, on_same.w, slope.w);
  vec3 lean = leaving_texel(first + 4).xyz;
  vec3 aslant = vec3(dot(unpack_lean(lean.x), to_viewer), dot(unpack_lean(lean.y), to_viewer), dot(unpack_lean(lean.z), to_viewer));
  sent = mean.xyz * max(vec3(1.0) + aslant + slope.xyz * (dot(normal, to_viewer) - MEAN_COSINE_SENT), vec3(0.0));
  same = on_same.xyz;
  return max_component(part) > 0.0;
}
