// Box around the receivers of each tile; low > high where there are none.
void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = receivers_size();
  if (place.x * TILE >= size.x || place.y * TILE >= size.y) {
    return;
  }
  vec3 low = vec3(1e30);
  vec3 high = vec3(-1e30);
  for (int k = 0; k < TILE * TILE; k++) {
    ivec2 pixel = place * TILE + ivec2(k % TILE, k / TILE);
    if (pixel.x < size.x && pixel.y < size.y) {
      vec4 receiver = receivers_fetch(pixel);
      if (receiver.w != 0.0) {
        low = min(low, receiver.xyz);
        high = max(high, receiver.xyz);
      }
    }
  }
  imageStore(low_of_tiles, place, vec4(low, 0.0));
  imageStore(high_of_tiles, place, vec4(high, 0.0));
}
