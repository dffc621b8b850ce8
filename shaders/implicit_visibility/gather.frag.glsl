// One bounce: the mean over the bins of each receiver of the radiance that their links send, which is irradiance over pi,
// since bins have equal projected solid angles; and what the receiver sends of it and of the direct light.
#include "lib/math.glsl"
#include "implicit_visibility/surfels.glsl"
#ifdef PLACES  // of receivers and nodes are bound, between which media lie
#include "lib/random.glsl"
#include "ask/media.glsl"

// What media let pass on a link.
vec3 passing_link(int receiver, int node, int bin)
{
  int i = receiver * RECEIVER_TEXELS;
  vec3 origin = receivers_fetch(ivec2(i & 2047, i >> 11)).xyz;
  vec3 path = surfel_node(node, 0).xyz - origin;
  float reach = length(path);
  uint salt = hash3(uvec3(uint(receiver), uint(bin), 57u)).x;
  return media_transmittance(origin, path / max(reach, 1e-30), reach, salt);
}
#endif

void main()
{
  out_arriving = vec4(0.0);
  out_sent = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int receiver = pixel.x + (pixel.y << RECEIVER_ROW);
  if (receiver >= receiver_count) {
    return;
  }
  int count = bins * bins;
  ivec2 first = ivec2((receiver % COLUMNS) * count, receiver / COLUMNS);
  vec3 sum = vec3(0.0);
  float linked = 0.0;
  for (int bin = 0; bin < count; bin++) {
    int entry = int(bin_links_fetch(ivec2(first.x + bin, first.y)).x) - 1;
    if (entry >= 0) {
      vec3 radiance = node_radiance_fetch(ivec2(entry & 2047, entry >> 11)).rgb;
#ifdef PLACES
      radiance *= passing_link(receiver, entry >> 1, bin);
#endif
      sum += radiance;
      linked += 1.0;
    }
  }
  out_arriving = vec4(sum, linked) / float(count);
  out_sent.rgb = reflectance_fetch(pixel).rgb * (direct_fetch(pixel).rgb + out_arriving.rgb);
}
