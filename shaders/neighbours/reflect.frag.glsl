// What a surface reflects of the light that arrives.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_diffuse = vec4(max(surface_diffuse_fetch(pixel).rgb, vec3(0.0)) * arriving_fetch(pixel).rgb, 0.0);
}
