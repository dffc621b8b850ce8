// Light of the one pixel of each rectangle that a sample draws, where it belongs (addon/sampling/interleaved.py).
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 from = pixel / rectangle;
  bool drawn = from * rectangle + place_within == pixel;
  out_diffuse = drawn ? weight * gathered_diffuse_fetch(from) : vec4(0.0);
  out_glossy = drawn ? weight * gathered_glossy_fetch(from) : vec4(0.0);
}
