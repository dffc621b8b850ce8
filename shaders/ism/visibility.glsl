// What maps of points say is hidden from them (`virtual_maps`, of `map_side` texels, `map_columns` in a row).
#include "ism/paraboloid.glsl"

#define SLACK 0.005  // of the distance, about the error of stored normals and of flat triangles on curved things

// Whether a place of a surface is seen by a virtual light, all in the frame of its map: not behind the plane of what the
// map shows there, unless that is the surface itself beside the place, bent away. On an arc the angle between two normals
// is that by which the chord leaves the tangent, twice.
float texel_visibility(ivec2 tile, ivec2 texel, vec3 place, vec3 normal, float slack, float parallel)
{
  Plane blocker = plane_unpack(virtual_maps_fetch(tile + texel).xy);
  float behind = dot(place, blocker.normal) - (blocker.distance - BIAS * parallel);
  // Maps of directions are as wide as the picture: there, what is not bent away at all needs little of the slack.
  float alike = -dot(normal, blocker.normal);
  float bend = sqrt(max(1.0 - alike * alike, 0.0));
  slack *= (parallel > 0.0 && alike > 0.5) ? clamp(10.0 * bend, 0.1, 1.0) : 1.0;
  if (blocker.distance <= 0.0 || behind <= slack) {
    return 1.0;
  }
  TexelRay ray = texel_ray(texel, map_side, parallel);
  float apart = length(ray.start + ray.direction * min(plane_along(blocker, ray, parallel), 1e15) - place);
  return (alike > 0.5 && behind < 0.75 * apart * bend + slack) ? 1.0 : 0.0;
}

// The share that a surface sees of a map's point, or of its direction: bilinear between what four texels say.
float map_visibility(int index, vec3 eye, vec3 axis, vec3 position, vec3 plane_normal, float parallel)
{
  mat3 frame = map_frame(axis);
  vec3 place = (position - eye) * frame;
  vec3 normal = plane_normal * frame;
  float away = (parallel > 0.0) ? parallel : length(place);
  vec2 point = (parallel > 0.0) ? place.xy / parallel : disc_point(place / max(away, 1e-30));
  vec2 spot = (point * 0.5 + 0.5) * float(map_side) - 0.5;
  ivec2 texel = ivec2(floor(spot));
  vec2 part = spot - vec2(texel);
  ivec2 tile = ivec2(index % map_columns, index / map_columns) * map_side;
  float visible = 0.0;
  for (int corner = 0; corner < 4; corner++) {
    ivec2 step_to = ivec2(corner & 1, corner >> 1);
    float weight = ((step_to.x == 1) ? part.x : 1.0 - part.x) * ((step_to.y == 1) ? part.y : 1.0 - part.y);
    ivec2 inside = clamp(texel + step_to, ivec2(0), ivec2(map_side - 1));
    visible += weight * texel_visibility(tile, inside, place, normal, SLACK * away, parallel);
  }
  return visible;
}
