// Light of the samples in which a part of a technique is drawn, for those in which it is not (addon/frame/shares.py).
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ALL
}
