// Texels whose middle sees a triangle, or a point's disc, cut off at its object's bounds. The depth test keeps what is
// nearest.
#include "ism/paraboloid.glsl"

void main()
{
  out_plane = vec2(0.0);
  gl_FragDepth = 1.0;
  ivec2 texel = ivec2(gl_FragCoord.xy) - ivec2(tile.xy);
  TexelRay ray = texel_ray(texel, map_side, half_extent);
  Plane own;
  own.distance = plane.w;
  own.normal = plane.xyz;
  own.whole = tile.z == TRIANGLE;
  float along = plane_along(own, ray, half_extent);
  if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, ivec2(map_side))) || ray.direction.z <= 0.0
      || along >= 1e30) {
    discard;
  }
  vec4 met = vec4(ray.start + along * ray.direction, 1.0);
  float margin = 1e-3 * sqrt(disc.w);
  bool inside;
  if (own.whole) {
    vec3 sides = vec3(dot(first_bound, met), dot(second_bound, met), dot(third_bound, met));
    inside = all(greaterThan(sides, vec3(-margin))) || all(lessThan(sides, vec3(margin)));
  }
  else {
    vec3 off = met.xyz - disc.xyz;
    inside = dot(off, off) <= disc.w;
    if (inside && tile.z == CUT_DISC) {
      ivec2 map = ivec2(tile.xy) / map_side;
      vec3 axis = virtual_lights_fetch(ivec2(map.y * map_columns + map.x, 1)).xyz;
      vec3 place = map_frame(axis) * met.xyz;
      inside = all(greaterThan(place, first_bound.xyz - margin)) && all(lessThan(place, second_bound.xyz + margin));
    }
  }
  if (!inside) {
    discard;
  }
  out_plane = plane_pack(own);
  if (half_extent > 0.0) {  // the stored normal is not quite this one: it tilts the plane about what the texel sees, not about the map's middle
    out_plane.x = dot(plane_unpack(out_plane).normal, met.xyz) + BIAS * half_extent;
  }
  float depth = along / (abs(along) + depth_unit);
  gl_FragDepth = (half_extent > 0.0) ? 0.5 + 0.5 * depth : depth;
}
