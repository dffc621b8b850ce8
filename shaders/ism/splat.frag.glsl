// Texels whose middle sees a point's disc, cut off at its object's bounds, or a triangle. The depth test keeps what is
// nearest.
#include "ism/paraboloid.glsl"

// Whether `place` lies to the left of an edge, by more than rounding; `up` is the normal of edge and place.
float beside(vec3 from, vec3 to, vec3 place, vec3 up)
{
  return dot(cross(to - from, place - from), up);
}

void main()
{
  out_plane = vec2(0.0);
  gl_FragDepth = 1.0;
  ivec2 map = ivec2(tile) / map_side;
  ivec2 texel = ivec2(gl_FragCoord.xy) - map * map_side;
  vec3 direction = texel_direction(texel, map_side);
  Plane own;
  own.distance = plane.w;
  own.normal = plane.xyz;
  own.whole = first_bound.w > 0.5;
  float along = plane_along(own, direction);
  if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, ivec2(map_side))) || direction.z <= 0.0
      || along >= 1e30) {
    discard;
  }
  vec3 met = along * direction;
  mat3 frame = map_frame(texelFetch(virtual_lights, ivec2(map.y * map_columns + map.x, 1), 0).xyz);
  vec3 place = frame * met;
  float margin = 1e-3 * sqrt(disc.w);
  bool inside;
  if (own.whole) {
    vec3 up = frame * own.normal;
    vec3 sides = vec3(beside(first_bound.xyz, second_bound, place, up),
                      beside(second_bound, third_bound, place, up),
                      beside(third_bound, first_bound.xyz, place, up));
    float slack = margin * sqrt(disc.w);
    inside = all(greaterThan(sides, vec3(-slack))) || all(lessThan(sides, vec3(slack)));
  }
  else {
    vec3 off = met - disc.xyz;
    inside = dot(off, off) <= disc.w && all(greaterThan(place, first_bound.xyz - margin))
             && all(lessThan(place, second_bound + margin));
  }
  if (!inside) {
    discard;
  }
  out_plane = plane_pack(own);
  gl_FragDepth = along / (along + depth_unit);
}
