// One pass of a Stockham transform along STEP: each texel is one output of a butterfly of RADIX inputs
// (addon/kernels/fft.py). Texels hold one complex number in xy, or two where TWO is defined.
// Source: Govindaraju, Lloyd, Dotsenko, Smith, Manferdelli 2008, written from an output's view: the twiddle of the pass
// and that of its small transform are powers of one number, so that a sum after Horner does both.
#define TURN 6.28318530717959

vec4 product(vec4 a, vec2 b)
{
#ifdef TWO
  return vec4(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x, a.z * b.x - a.w * b.y, a.z * b.y + a.w * b.x);
#else
  return vec4(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x, 0.0, 0.0);
#endif
}

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  ivec2 along = STEP;
  int place = texel.x * along.x + texel.y * along.y;
  int block = place / (RADIX * done);
  int rest = place - block * (RADIX * done);
  int first = block * done + rest % done;
  // The angle in (-half a turn, half a turn], where sines are most exact.
  float share = float(rest) / float(RADIX * done);
  share -= (share > 0.5) ? 1.0 : 0.0;
  float angle = direction * TURN * share;
  vec2 twiddle = vec2(cos(angle), sin(angle));
  ivec2 input_texel = texel + along * (first + (RADIX - 1) * apart - place);
  vec4 sum = vec4(0.0);
  for (int k = 0; k < RADIX; k++) {
    sum = product(sum, twiddle);
    // Beyond `filled` the image is zero, whatever it holds.
    if (input_texel.x * along.x + input_texel.y * along.y < filled) {
      sum += field_fetch(input_texel);
    }
    input_texel -= along * apart;
  }
  out_field = sum * scale;
}
