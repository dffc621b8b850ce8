// Where in the world the surface lies; the origin where there is none.
void main()
{
  vec4 position = surface_position_fetch(ivec2(gl_FragCoord.xy));
  out_position = (position.w != 0.0) ? vec4(position.xyz + render_origin, 1.0) : vec4(0.0);
}
