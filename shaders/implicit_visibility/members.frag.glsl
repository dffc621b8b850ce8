// Where each receiver is lit: another point of its cell each time, so that what is lit of a cell counts by its share.
#include "lib/math.glsl"
#include "implicit_visibility/surfels.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int receiver = pixel.x + (pixel.y << RECEIVER_ROW);
  out_position = vec4(0.0);
  out_normal = vec4(0.0);
  if (receiver >= receiver_count || shaded_fetch(pixel).w == 0.0) {
    return;
  }
  int facing = receiver * RECEIVER_TEXELS + 1;
  vec4 own = receivers_fetch(ivec2(facing & 2047, facing >> 11));
  int i = (int(own.w) * MEMBERS + member) * 2;
  vec3 normal = members_fetch(ivec2((i + 1) & 2047, (i + 1) >> 11)).xyz;
  vec2 packed_normal = octahedral_encode((dot(normal, own.xyz) < 0.0) ? -normal : normal);
  out_position = vec4(members_fetch(ivec2(i & 2047, i >> 11)).xyz, 1.0);
  out_normal = vec4(packed_normal, packed_normal);
}
