// Maps of half the side, of points alone: the nearest of four planes, where most of the four lie on about that plane.
#include "ism/paraboloid.glsl"

void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy);
  ivec2 map = place / map_side;
  TexelRay ray = texel_ray(place - map * map_side, map_side, half_extent);
  float nearest = 1e30;
  vec4 depths = vec4(1e30);
  out_plane = vec2(0.0);
  for (int child = 0; child < 4; child++) {
    vec2 texel = finer_maps_fetch(2 * place + ivec2(child & 1, child >> 1)).xy;
    Plane plane = plane_unpack(texel);
    depths[child] = plane.whole ? 1e30 : plane_along(plane, ray, half_extent);
    if (depths[child] < nearest) {
      nearest = depths[child];
      out_plane = texel;
    }
  }
  vec4 alike = vec4(lessThanEqual(depths, vec4(nearest + threshold * ((half_extent > 0.0) ? half_extent : nearest))));
  if (dot(alike, vec4(1.0)) < 2.5) {
    out_plane = vec2(0.0);
  }
}
