// The picture: the sum of all light paths. With a transparent film the world shows in its own pass only.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 world = environment_fetch(pixel);
  vec3 direct = diffuse_direct_fetch(pixel).rgb + glossy_direct_fetch(pixel).rgb
                + transmission_direct_fetch(pixel).rgb;
  vec3 indirect = diffuse_indirect_fetch(pixel).rgb + glossy_indirect_fetch(pixel).rgb
                  + transmission_indirect_fetch(pixel).rgb;
  vec3 sum = direct + indirect + emission_fetch(pixel).rgb;
#ifdef VOLUMES
  sum += volume_direct_fetch(pixel).rgb + volume_indirect_fetch(pixel).rgb;
#endif
  if (transparent == 0) {
    sum += world.rgb;
  }
  out_combined = vec4(sum * (scale * exposure), clamp(world.a * scale, 0.0, 1.0));
}
