// The caustic map on the picture: what diffuse closures reflect of the irradiance that it holds for their place. Of the four
// texels around it those count that show the same surface; `map_view` is the light's.
#include "lib/gbuffer.glsl"
#include "caustics/map_texels.glsl"

void main()
{
  out_light = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 place = surface_position_fetch(pixel);
  if (place.w == 0.0) {
    return;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  ivec2 size = receiver_position_size();
  MapPlace at = map_place(place.xyz, size);
  if (!at.inside) {
    return;
  }
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int k = 0; k < 4; k++) {
    ivec2 other = map_texel(at, k, size);
    vec4 there = receiver_position_fetch(other);
    vec3 facing = octahedral_decode(receiver_normal_fetch(other).zw);
    bool same = there.w != 0.0 && dot(facing, normal) > 0.7;
    float weight = same ? map_weight(at, k, there.xyz - place.xyz, normal) : 0.0;
    sum += weight * caustic_map_fetch(other).rgb;
    weights += weight;
  }
  if (weights > 0.0) {
    out_light = vec4(sum / weights * surface_diffuse_fetch(pixel).rgb / PI, 0.0);
  }
}
