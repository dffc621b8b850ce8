// A field behind what stands in a plane: the mean of 2x2 texels of its transmittance.
void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  ivec2 fine = 2 * texel;
  float open_part = 0.25 * (aperture_fetch(fine).x + aperture_fetch(fine + ivec2(1, 0)).x
                            + aperture_fetch(fine + ivec2(0, 1)).x + aperture_fetch(fine + ivec2(1, 1)).x);
  out_field = vec4(open_part * field_fetch(texel).xy, 0.0, 0.0);
}
