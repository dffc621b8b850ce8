// For points on an object: its depth and the mean length of lines from there through it, m, by rays of the cosine's density
// inwards, the shading normal, and how translucent the surface is there. What no ray leaves again, since the mesh is open,
// counts as `longest`. The depth is the harmonic mean of lengths: 1.5 times a slab's thickness, a ball's radius;
// and no more than the radius of curvature.
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
  float per = 0.0;
  for (int k = 0; k < CHORDS; k++) {
    vec2 u = fract(vec2(to_unit(roll.x), to_unit(roll.y)) + vec2(float(k) / float(CHORDS), to_unit(reverse_bits(uint(k)))));
    ivec2 hit;
    vec3 direction = cosine_direction(-face, u);
    float d = min(trace_until(origin, direction, longest, 0.0, roll.z + uint(k), hit), longest);
    sum += d;
    per += 1.0 / max(d, 1e-20);
  }
  out_shape = vec4(pack_normal(octahedral_decode(normals.xy)), min(float(CHORDS) / per, point_curve_fetch(texel).x), sum / float(CHORDS), point_entry_fetch(texel).w);
}
