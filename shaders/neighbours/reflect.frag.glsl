// What a surface reflects of the light that arrives.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_diffuse = vec4(max(texelFetch(surface_diffuse, pixel, 0).rgb, vec3(0.0)) * texelFetch(arriving, pixel, 0).rgb, 0.0);
}
