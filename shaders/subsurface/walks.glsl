// What random walks below surfaces need: how they enter, where the object ends, which cell is near. A program that includes this
// binds the hierarchy, `trace_owners`, `scatter_near`, `film_view`, and has the constants `first_leaf` and `offset_size`.
#include "trace/rays.glsl"
#include "subsurface/image.glsl"
#include "subsurface/profile.glsl"

#define SPREAD 0.7  // distances between points, over which their light is spread
#define LAYERS 4    // surfaces of other objects that a ray passes

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

// Row of the instance that a ray has met.
float instance_of(ivec2 hit)
{
#ifdef INSTANCED
  if (HIT_RECORD(hit) != 0) {
    return owner_texel(int(node_texel(HIT_RECORD(hit) * NODE_TEXELS + 3).y)).x;
  }
#endif
  return owner_texel((hit.x - first_leaf) * 4 + HIT_SLOT(hit)).x;
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
    begun += t;
    if (instance_of(hit) == instance) {
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
