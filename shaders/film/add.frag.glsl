// This sample's light, into the sums.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_diffuse_direct = vec4(film_share * light_diffuse_direct_fetch(pixel).rgb, 0.0);
  out_diffuse_indirect = vec4(film_share * light_diffuse_indirect_fetch(pixel).rgb, 0.0);
  out_glossy_direct = vec4(film_share * light_glossy_direct_fetch(pixel).rgb, 0.0);
  out_glossy_indirect = vec4(film_share * light_glossy_indirect_fetch(pixel).rgb, 0.0);
#ifdef TRANSMISSION
  out_transmission_direct = vec4(film_share * light_transmission_direct_fetch(pixel).rgb, 0.0);
  out_transmission_indirect = vec4(film_share * light_transmission_indirect_fetch(pixel).rgb, 0.0);
#endif
}
