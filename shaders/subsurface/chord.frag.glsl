// For points on an object: the mean length of lines from there through it, m, by rays of the cosine's density inwards, the shading
// normal, and how translucent the surface is there. What no ray leaves again, since the mesh is open, counts as `longest`.
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "trace/rays.glsl"

#define CHORDS 32

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = point_position_fetch(texel);
  vec4 normals = point_normal_fetch(texel);
  vec3 face = octahedral_decode(normals.zw);
  vec3 origin = ray_origin(place.xyz, -face);
  uvec3 roll = hash3(uvec3(uvec2(texel), 5u));
  float sum = 0.0;
  for (int k = 0; k < CHORDS; k++) {
    vec2 u = fract(vec2(to_unit(roll.x), to_unit(roll.y)) + vec2(float(k) / float(CHORDS), to_unit(reverse_bits(uint(k)))));
    ivec2 hit;
    vec3 direction = cosine_direction(-face, u);
    sum += min(trace_until(origin, direction, longest, longest, roll.z + uint(k), hit), longest);
  }
  out_shape = vec4(normals.xy, sum / float(CHORDS), point_entry_fetch(texel).w);
}
