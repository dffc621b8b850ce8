// A square about the light of one tile, as large as the kernel; none for a dark tile.
void main()
{
  int columns = tile_light_size().x;
  ivec2 tile = ivec2(gl_InstanceID % columns, gl_InstanceID / columns);
  light = tile_light_fetch(tile);
  middle = tile_place_fetch(tile).xy;
  vec2 at = middle + (2.0 * corner - 1.0) * (float(reach) + 1.0);
  bool dark = max(max(light.r, light.g), light.b) <= 0.0;
  gl_Position = dark ? vec4(2.0, 2.0, 2.0, 1.0) : vec4(at / extent * 2.0 - 1.0, 0.0, 1.0);
}
