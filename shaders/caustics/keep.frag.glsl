// What is kept of a light's caustic map for hits: irradiance, and how far along the view's axis its surface lies; 0: none.

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy) - cell_corner;
  vec4 place = receiver_position_fetch(texel);
  out_kept = vec4(0.0);
  if (place.w != 0.0) {
    out_kept = vec4(caustic_map_fetch(texel).rgb, dot(map_view.eye.xyz - place.xyz, map_view.backward.xyz));
  }
}
