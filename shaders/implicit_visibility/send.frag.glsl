// What receivers send of the direct light that arrives there.

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_sent = vec4(reflectance_fetch(pixel).rgb * direct_fetch(pixel).rgb, 0.0);
}
