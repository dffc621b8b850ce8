// Light of several paths as one image; FOLDED: its sum (film/together.py).

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_sum = FOLDED;
}
