// Puts the light that left surfaces in the place of the light that entered them, where anything scatters. Of walks, that is
// what points brought, and by the weight of what left near the pixel the light that pixels there have.
void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (scatter_share_fetch(pixel).w < 4.0) {
    discard;
  }
  out_walked = vec4(vec3(walked_near_fetch(pixel).w), 1.0);
  out_direct = left_direct_fetch(pixel);
  out_indirect = left_indirect_fetch(pixel);
  vec4 near = walked_near_fetch(pixel);
  if (near.w > 0.0) {
    vec3 leaves = near.w * surface_diffuse_fetch(pixel).rgb * scatter_share_fetch(pixel).rgb;
    out_direct.rgb += leaves * walked_direct_fetch(pixel).rgb + near.rgb * near_direct_fetch(pixel).rgb;
    out_indirect.rgb += leaves * walked_indirect_fetch(pixel).rgb + near.rgb * near_indirect_fetch(pixel).rgb;
  }
}
