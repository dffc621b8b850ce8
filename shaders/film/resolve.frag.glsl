// The picture: the sum of all light paths. With a transparent film the world shows in its own pass only.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 world = texelFetch(environment, pixel, 0);
  vec3 direct = texelFetch(diffuse_direct, pixel, 0).rgb + texelFetch(glossy_direct, pixel, 0).rgb
                + texelFetch(transmission_direct, pixel, 0).rgb;
  vec3 indirect = texelFetch(diffuse_indirect, pixel, 0).rgb + texelFetch(glossy_indirect, pixel, 0).rgb
                  + texelFetch(transmission_indirect, pixel, 0).rgb;
  vec3 sum = direct + indirect + texelFetch(emission, pixel, 0).rgb;
  if (transparent == 0) {
    sum += world.rgb;
  }
  out_combined = vec4(sum * (scale * exposure), clamp(world.a * scale, 0.0, 1.0));
}
