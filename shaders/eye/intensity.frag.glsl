// Squared amplitude, as a share of all light that passes the aperture's square.
void main()
{
  vec2 amplitude = field_fetch(ivec2(gl_FragCoord.xy)).xy;
  out_intensity = vec4(dot(amplitude, amplitude) * scale);
}
