// What gloss at points sends of direct light, by direction: `out_flux`, the integral of its radiance over all directions, and
// `out_ways`, the mean of these directions times its luminance, so that both are means over what is below a node. w: the
// area. `out_all`: direct light with the same as of a diffuse surface, for groups, which do not look at directions. `out_thrown`: of
// the flux what photons bring to diffuse surfaces of the picture, and to no others.
#include "lib/math.glsl"
#include "micro/spread.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 lobe = gloss_fetch(pixel);
  vec4 mirrored = ways_fetch(pixel);
  vec3 axis = octahedral_decode(point_normal_fetch(pixel).xy);
  float area = sent_fetch(pixel).w;
  vec4 falling = across_fetch(pixel);
  vec3 flux = lobe.rgb * falling.rgb;
  float thrown = (lobe.w < 0.0) ? clamp(falling.w / max(mirrored.w, DARK), 0.0, 1.0) : 0.0;
  bool finite = is_finite(flux.r + flux.g + flux.b) && is_finite(mirrored.x + mirrored.y + mirrored.z + mirrored.w) && mirrored.w > 0.0;
  flux = finite ? max(flux, vec3(0.0)) : vec3(0.0);
  vec3 mean = finite ? mirrored.xyz / mirrored.w : vec3(0.0);
  float cosine = clamp(dot(mean, axis), 0.0, 1.0);
  out_flux = vec4(flux, area);
  out_ways = vec4(mean * (length_of_mirrored(lobe.w, cosine) * luminance(flux)), area);
  out_thrown = vec4(flux * thrown, area);
  out_all = vec4(direct_fetch(pixel).rgb + flux * (cosine / PI), 0.0);
}
