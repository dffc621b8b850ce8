// The edit of a reflected direction at a place: moving least squares over constraints (T. Ritschel et al., "Interactive
// reflection editing", 2009, as told in chapter 7 of his thesis; interpolation of rotations by quaternions after Horn).
//
// The block `edits` holds 2 vec4 for each region: centre, radius; width of the border, kind plus 4 for each layer of
// distances up to its own, two times 16 bits of which constraints are in it; and 3 for each constraint: place, its layer
// of distances or -1; direction before; after, 1 where it is about what is bent. Programs define `distance_layer`.
#include "lib/math.glsl"
#include "edit/rotation.glsl"

#define REGION_EUCLIDEAN 0
#define REGION_GEODESIC 1
#define REGION_PAINTED 2
#define UNREACHED 1e18
#define PRIOR 1e-4  // of no rotation: resolves the spin that single pairs leave open

// 1 inside, 0 outside, smooth across the border.
float region_influence(float away, float radius, float border)
{
  if (border <= 0.0) {
    return (away <= radius) ? 1.0 : 0.0;
  }
  return 1.0 - smoothstep(radius - border, radius, away);
}

float constraint_distance(int n, vec3 position, bool geodesic)
{
  vec4 place = edits.pair[3 * n];
  return (geodesic && place.w >= 0.0) ? distance_layer(int(place.w)) : distance(position, place.xyz);
}

float region_share(int k, vec3 position)
{
  vec4 where = edits.region[2 * k];
  vec4 shape = edits.region[2 * k + 1];
  int kind = int(shape.y) & 3;
  int layer = (int(shape.y) >> 2) - 1;
  float value = (layer >= 0) ? distance_layer(layer) : distance(position, where.xyz);
  return (kind == REGION_PAINTED) ? clamp(value, 0.0, 1.0) : region_influence(value, where.w, shape.x);
}

mat3 outer(vec3 e, vec3 r)
{
  return mat3(e * r.x, e * r.y, e * r.z);
}

bool in_region(vec2 members, int n)
{
  float bits = (n < 16) ? members.x : members.y;
  return mod(floor(bits / exp2(float(n & 15))), 2.0) >= 1.0;
}

// Rotation of a region's constraints at a place; false where none of them can be reached.
bool region_rotation(vec3 position, int region, bool bent, out vec4 q)
{
  vec4 shape = edits.region[2 * region + 1];
  bool geodesic = (int(shape.y) & 3) == REGION_GEODESIC;
  float nearest = UNREACHED;
  for (int n = 0; n < constraint_count; n++) {
    if (in_region(shape.zw, n) && (edits.pair[3 * n + 2].w > 0.5) == bent) {
      nearest = min(nearest, constraint_distance(n, position, geodesic));
    }
  }
  q = vec4(0.0, 0.0, 0.0, 1.0);
  if (nearest >= UNREACHED) {
    return false;
  }
  float least = max(nearest, distance_floor);
  mat3 b = mat3(PRIOR);
  for (int n = 0; n < constraint_count; n++) {
    if (in_region(shape.zw, n) && (edits.pair[3 * n + 2].w > 0.5) == bent) {
      float away = max(constraint_distance(n, position, geodesic), distance_floor);
      if (away < UNREACHED) {
        b += (least * least / (away * away)) * outer(edits.pair[3 * n + 2].xyz, edits.pair[3 * n + 1].xyz);
      }
    }
  }
  q = rotation_nearest(b);
  return true;
}

// The rotation of what arrives along `r` (bent: of what passes; 0: nobody knows), and how much of it regions let through. No
// edit: w = 0 of all four.
vec4 edited_rotation(vec3 position, vec3 r, bool bent)
{
  vec4 found = vec4(0.0);
  float total = 0.0;
  for (int k = 0; k < region_count; k++) {
    total += region_share(k, position);
  }
  if (total <= 0.0) {
    return found;
  }
  float scale = 1.0 / max(total, 1.0);
  mat3 sum = mat3(0.0);
  float used = 0.0;
  int regions = 0;
  for (int k = 0; k < region_count; k++) {
    float share = region_share(k, position) * scale;
    vec4 q;
    if (share > 0.0 && region_rotation(position, k, bent, q)) {
      found = q;
      used += share;
      regions++;
      sum += share * mat3(quaternion_turned(q, vec3(1.0, 0.0, 0.0)), quaternion_turned(q, vec3(0.0, 1.0, 0.0)),
                          quaternion_turned(q, vec3(0.0, 0.0, 1.0)));
    }
  }
  if (regions == 0 || (regions == 1 && used >= 1.0)) {
    return found;
  }
  return rotation_nearest(sum + max(1.0 - used, 0.0) * ((dot(r, r) > 0.0) ? outer(r, r) : mat3(1.0)));
}
