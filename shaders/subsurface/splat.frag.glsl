// What of the light that entered at one place leaves at the pixel, before the way out: R_d(|x_i - x_o|) E dA.
#include "lib/math.glsl"
#include "subsurface/dipole.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 transport = dipole_transport_fetch(pixel);
  if (floor(transport.w) != floor(splat_point.w)) {
    discard;
  }
  float r = distance(surface_position_fetch(pixel).xyz, splat_point.xyz);
  if (r > splat_flux.w) {
    discard;
  }
  vec4 real = dipole_real_fetch(pixel);
  Dipole profile;
  profile.real = real.xyz;
  profile.transport = transport.xyz;
  profile.slope = real.w;
  float translucent = 2.0 * min(fract(transport.w), fract(splat_point.w));
  out_light = vec4(translucent * dipole_at(profile, r) * splat_flux.rgb, 0.0);
}
