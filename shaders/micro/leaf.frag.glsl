// Radiance that each side of each point sends: of direct light, and of what its group gathered. w: its area. WAYS: without what
// gloss mirrors of the part that comes from one direction (micro/bounced.frag.glsl).
#include "lib/math.glsl"
#ifdef WAYS
#include "micro/directed.glsl"
#endif

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int entry = pixel.y * POINT_ROW + pixel.x;
  int leaf = entry >> 1;
  int index = 3 * (leaf_count + leaf) + 1;
  float size = tree_nodes_fetch(ivec2(index & 2047, index >> 11)).w;
  float apex = tree_nodes_fetch(ivec2((index + 1) & 2047, (index + 1) >> 11)).w;
  float area = (apex > 0.0) ? size * apex : (PI / (COVER * COVER)) * size * size;
  vec3 sent = direct_fetch(pixel).rgb;
  if (group_count > 0) {
    int group = int(shares_fetch(pixel).x);
    ivec2 gathered = ivec2(group % NODE_ROW, group / NODE_ROW);
    vec3 light = arriving_fetch(gathered).rgb;
    vec3 reflected = albedo_fetch(pixel).rgb;
#ifdef WAYS
    vec3 normal = octahedral_decode(point_normal_fetch(pixel).xy);
    float mirrored = directed_share(arriving_way_fetch(gathered).xyz, luminance(light), normal).w;
    reflected = max(reflected - mirrored * gloss_fetch(pixel).rgb, vec3(0.0));
#endif
    sent += reflected * (1.0 / PI) * light;
  }
  // A point that is not there (its material has no surface) sends nothing, but what lies behind it is hidden.
  bool finite = is_finite(sent.r + sent.g + sent.b);
  out_sent = vec4(finite ? max(sent, vec3(0.0)) : vec3(0.0), area);
}
