// Virtual lights whose maps tell what they see: all of them, without a ray and without noise.
#include "indirect/lights.glsl"
#include "ism/paraboloid.glsl"

#define SLACK 0.005  // of the distance, about the error of stored normals and of flat triangles on curved things

// Whether a surface is seen by a virtual light: not behind the plane of what the light's map shows there, unless that is
// the surface itself beside the place, bent away. On an arc the angle between two normals is that by which the chord
// leaves the tangent, twice.
float map_visibility(int index, VirtualLight light, vec3 position, vec3 surface_normal)
{
  mat3 frame = map_frame(light.normal);
  vec3 place = (position - light.position) * frame;
  float slack = SLACK * length(place);
  ivec2 texel = ivec2((disc_point(place / max(length(place), 1e-30)) * 0.5 + 0.5) * float(map_side));
  texel = clamp(texel, ivec2(0), ivec2(map_side - 1));
  ivec2 tile = ivec2(index % map_columns, index / map_columns) * map_side;
  Plane blocker = plane_unpack(texelFetch(virtual_maps, tile + texel, 0).xy);
  float behind = dot(place, blocker.normal) - blocker.distance;
  if (blocker.distance <= 0.0 || behind <= slack) {
    return 1.0;
  }
  vec3 normal = surface_normal * frame;
  float alike = -dot(normal, blocker.normal);
  vec3 direction = texel_direction(texel, map_side);
  float apart = length(direction * min(plane_along(blocker, direction), 1e15) - place);
  return (alike > 0.5 && behind < 0.75 * apart * sqrt(max(1.0 - alike * alike, 0.0)) + slack) ? 1.0 : 0.0;
}

vec3 virtual_gather(Surface s, vec3 to_viewer, bool reflected, vec3 origin, float u, uint salt)
{
  vec3 sum = vec3(0.0);
  for (int i = 0; i < virtual_count; i++) {
    VirtualLight light = virtual_light(i);
    vec3 direction;
    float kernel = bounded_kernel(light, s.position, direction);
    float cosine = dot(s.normal, direction);
    if (kernel > 0.0 && cosine > 0.0 && dot(direction, s.geometric_normal) > 0.0) {
      vec3 arriving = light.intensity * kernel * map_visibility(i, light, s.position, s.geometric_normal);
      sum += arriving * (reflected ? diffuse_reflection(s.diffuse, s.diffuse_roughness, s.normal, to_viewer, direction)
                                   : vec3(cosine));
    }
  }
  return sum;
}
