// A field's transform, carried on over a distance by Fresnel's transfer function; the straight direction is in the middle.
#define PI 3.14159265358979

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec2 away = vec2(texel - field_size() / 2);
  float angle = phase_per_step2 * dot(away, away);
  angle -= 2.0 * PI * floor(angle / (2.0 * PI) + 0.5);
  vec2 u = field_fetch(texel).xy;
  float c = cos(angle);
  float s = sin(angle);
  out_field = vec4(u.x * c + u.y * s, u.y * c - u.x * s, 0.0, 0.0);
}
