// A picture with direct light alone, and a little light from the eye in place of indirect light
// (addon/surfaces/first_look.py).
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 lit = coarse_fetch(pixel);
  out_fine = vec4(lit.rgb + look_fetch(pixel).rgb, lit.a);
}
