// Stores the caster's plane: q at the texel's centre and its change per texel (see lib/shadow.glsl).
void main()
{
  float q = depth_terms.x / depth_terms.y;
  out_depth = vec4(q, dFdx(q), dFdy(q), 1.0);
}
