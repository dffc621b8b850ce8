// The share of RAYS cosine-weighted rays from each point that meets a surface (addon/scene/seen.py).
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "trace/rays.glsl"

void main()
{
  out_seen = 0.0;
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec3 normal = normals_fetch(pixel).xyz;
  if (dot(normal, normal) < 0.5) {
    return;
  }
  vec3 origin = places_fetch(pixel).xyz + 8.0 * offset_size * normal;
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  uvec3 roll = hash3(uvec3(uvec2(pixel), 211u));
  float met = 0.0;
  for (int i = 0; i < RAYS; i++) {
    float turn = 2.0 * PI * fract(to_unit(roll.x) + float(i) * 0.6180339887);
    float square = fract(to_unit(roll.y) + (float(i) + 0.5) / float(RAYS));
    float radius = sqrt(square);
    vec3 direction = radius * (cos(turn) * tangent + sin(turn) * bitangent) + sqrt(max(1.0 - square, 1e-4)) * normal;
    ivec2 hit;
    met += (trace_until(origin, normalize(direction), 1e29, 0.0, 0u, hit) < 1e29) ? 1.0 : 0.0;
  }
  out_seen = met / float(RAYS);
}
