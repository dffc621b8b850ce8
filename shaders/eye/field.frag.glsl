// Complex amplitude behind the aperture: the mean of 2x2 texels, turned by what defocus adds to the path, and by half a
// turn on every other texel, which puts the straight direction into the middle of the transform.
#define PI 3.14159265358979

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  ivec2 fine = 2 * texel;
  float open_part = 0.25 * (aperture_fetch(fine).x + aperture_fetch(fine + ivec2(1, 0)).x
                            + aperture_fetch(fine + ivec2(0, 1)).x + aperture_fetch(fine + ivec2(1, 1)).x);
  vec2 place = (gl_FragCoord.xy * spacing_mm - 0.5 * window_mm);
  float angle = phase_per_mm2 * dot(place, place);
  // Whole turns taken off, since sines of large angles are poor on some GPUs.
  angle -= 2.0 * PI * floor(angle / (2.0 * PI) + 0.5);
  float parity = ((texel.x + texel.y) % 2 == 0) ? 1.0 : -1.0;
  out_field = vec4(parity * open_part * vec2(cos(angle), sin(angle)), 0.0, 0.0);
}
