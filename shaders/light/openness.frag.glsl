// Sums over samples of the world's light that arrived at a pixel and that was drawn, which the lighting pass leaves in
// what the radiance images have left over.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_openness = vec4(openness_fetch(pixel).xy + vec2(diffuse_fetch(pixel).w, glossy_fetch(pixel).w), 0.0, 0.0);
}
