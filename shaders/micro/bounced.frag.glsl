// What gloss at points sends of bounced light, by direction, to be added to that of direct light (micro/lobes.frag.glsl): of what
// each point's group gathered the part that comes from one direction. The rest goes to all sides (micro/leaf.frag.glsl).
#include "lib/math.glsl"
#include "micro/directed.glsl"
#include "micro/spread.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_flux = vec4(0.0);
  out_ways = vec4(0.0);
  vec4 lobe = gloss_fetch(pixel);
  int group = int(shares_fetch(pixel).x);
  ivec2 gathered = ivec2(group % NODE_ROW, group / NODE_ROW);
  vec3 light = arriving_fetch(gathered).rgb;
  vec3 normal = octahedral_decode(point_normal_fetch(pixel).xy);
  vec4 directed = directed_share(arriving_way_fetch(gathered).xyz, luminance(light), normal);
  float cosine = dot(directed.xyz, normal);
  vec3 flux = max(lobe.rgb, vec3(0.0)) * light * (directed.w / max(cosine, LEAST_COSINE));
  if (is_finite(flux.r + flux.g + flux.b)) {
    out_flux = vec4(flux, 0.0);
    out_ways = vec4(reflect(-directed.xyz, normal) * (length_of_mirrored(lobe.w, cosine) * luminance(flux)), 0.0);
  }
}
