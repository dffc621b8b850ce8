// A kernel about the corner of a larger image: what lies left of or below its middle comes in from the other end.
void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  ivec2 offset = texel - ivec2(greaterThan(texel, ivec2(reach))) * extent;
  bool inside = all(greaterThanEqual(offset, ivec2(-reach))) && all(lessThanEqual(offset, ivec2(reach)));
  out_light = inside ? vec4(weights_fetch(offset + ivec2(reach)).rgb, 0.0) : vec4(0.0);
}
