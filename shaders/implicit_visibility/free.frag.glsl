// How far the surface runs freely around each receiver: rays a little above it to eight sides, of REACH radii. One over the
// distance, measured along the surface, to what stands on it there, 0 where nothing does. A wall that stands on a floor keeps
// light of the one side from being shown on the other (show.frag.glsl).
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "trace/rays.glsl"
#include "implicit_visibility/surfels.glsl"
#include "implicit_visibility/around.glsl"

float blocked(vec3 origin, vec3 normal, float radius, int side)
{
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  float angle = float(side) * (2.0 * PI / float(AROUND_SIDES));
  vec3 direction = normalize(cos(angle) * tangent + sin(angle) * bitangent + RISE * normal);
  float limit = AROUND * radius;
  ivec2 hit;
  float t = trace_until(origin, direction, limit, 0.0, 0u, hit);
  return (t < limit) ? sqrt(1.0 + RISE * RISE) / max(t, 1e-3 * radius) : 0.0;
}

void main()
{
  out_free_a = vec4(0.0);
  out_free_b = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int receiver = pixel.x + (pixel.y << RECEIVER_ROW);
  if (receiver >= receiver_count) {
    return;
  }
  int i = receiver * RECEIVER_TEXELS;
  vec4 place = receivers_fetch(ivec2(i & 2047, i >> 11));
  vec3 normal = receivers_fetch(ivec2((i + 1) & 2047, (i + 1) >> 11)).xyz;
  vec3 origin = place.xyz + max(LIFTED * place.w, 8.0 * offset_size) * normal;
  for (int side = 0; side < 4; side++) {
    out_free_a[side] = blocked(origin, normal, place.w, side);
    out_free_b[side] = blocked(origin, normal, place.w, side + 4);
  }
}
