// Indirect light that reaches points on objects below which light scatters: rays of the cosine's density, each with all that
// the surface it meets sends. What a surface of albedo 1 there reflects of it: irradiance over pi.
#include "indirect/near.glsl"

void main()
{
  out_indirect = vec4(0.0);
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = point_position_fetch(texel);
  if (place.w == 0.0) {
    return;
  }
  vec4 normals = point_normal_fetch(texel);
  vec3 normal = octahedral_decode(normals.xy);
  vec3 face = octahedral_decode(normals.zw);
  vec3 origin = ray_origin(place.xyz, face);
  uvec3 roll = roll_of(texel, film_view.sample_index, film_view.seed, 223);
  vec2 shift = vec2(to_unit(roll.x), to_unit(roll.y));
  for (int k = 0; k < rays; k++) {
    roll = hash3(roll);
    vec2 u = fract(shift + vec2(float(k) / float(rays), float(reverse_bits(uint(k)) >> 8u) / 16777216.0));
    vec3 direction = cosine_direction(normal, u);
    if (dot(direction, face) > 0.0) {
      out_indirect.rgb += near_radiance(origin, direction, true, false, false, false, roll) / float(rays);
    }
  }
  out_indirect.rgb *= point_entry_fetch(texel).rgb;
}
