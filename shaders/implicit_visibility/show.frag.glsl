// Indirect light at pixels from that of the surfels around, by least squares: of surfels within REACH radii, those that lie
// in the pixel's plane and face alike say what arrives at the pixel, each weighted by distance, and a linear function fitted
// to them says what does at the pixel itself. So light goes on to the edges of surfaces, where all surfels lie to one side.
#include "lib/gbuffer.glsl"
#include "implicit_visibility/surfels.glsl"
#include "implicit_visibility/around.glsl"

#define OFF_PLANE 0.5  // radii
#define LEAST 1e-6     // of a surfel that faces another way, or stands behind something: where there is none better

vec3 arriving_at(vec3 place, vec3 normal, vec3 face)
{
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(face, tangent, bitangent);
  vec3 level = vec3(0.0);
  vec3 slope_u = vec3(0.0);
  vec3 slope_v = vec3(0.0);
  vec3 moments = vec3(0.0);  // 1, u, v
  vec3 squares = vec3(0.0);  // u u, u v, v v
  for (int node = 0; node < node_count;) {
    vec4 ball = surfel_node(node, 0);
    vec4 disc = surfel_node(node, 1);
    vec3 off = ball.xyz - place;
    float square = dot(off, off);
    float reach = REACH * ball.w;
    bool leaf = int(disc.w) == node + 1;
    if (square < reach * reach && !leaf) {
      node += 1;
      continue;
    }
    node = int(disc.w);
    if (square >= reach * reach) {
      continue;
    }
    vec3 disc_normal = octahedral_decode(disc.xy);
    vec4 leaves = surfel_node(node - 1, 2);
    float cosine = dot(disc_normal, normal);
    bool front = dot(disc_normal, face) > 0.0;
    vec4 own = surfel_leaves_fetch(ivec2(int(leaves.x) & 2047, int(leaves.x) >> 11));
    int receiver = int(front ? own.y : own.z);
    float alike = max(front ? cosine : -cosine, 0.0);
    bool dark = receiver < -1;  // the back of a sheet that sees nothing
    if (receiver < 0) {
      receiver = int(own.y);
      alike = dark ? alike : 0.0;
    }
    ivec2 stored = receiver_pixel(receiver);
    vec4 known = dark ? vec4(0.0) : arriving_fetch(stored);
    int facing = receiver * RECEIVER_TEXELS + 1;
    vec3 own_normal = receivers_fetch(ivec2(facing & 2047, facing >> 11)).xyz;
    float seen = dark ? 1.0 : seen_around(free_a_fetch(stored), free_b_fetch(stored), own_normal, -off, ball.w);
    float near = 1.0 - square / (reach * reach);
    float beside = dot(off, face) / (OFF_PLANE * ball.w);
    alike *= alike;
    float weight = near * near * max(alike * alike * seen * exp(-beside * beside), LEAST);
    float u = dot(off, tangent) / ball.w;
    float v = dot(off, bitangent) / ball.w;
    level += weight * known.rgb;
    slope_u += weight * u * known.rgb;
    slope_v += weight * v * known.rgb;
    moments += weight * vec3(1.0, u, v);
    squares += weight * vec3(u * u, u * v, v * v);
  }
  if (moments.x <= 0.0) {
    return vec3(0.0);
  }
  // The first row of the inverse of the normal equations, in the fit's own middle.
  vec3 mean = level / moments.x;
  vec2 middle = moments.yz / moments.x;
  float uu = squares.x / moments.x - middle.x * middle.x + STIFF;
  float uv = squares.y / moments.x - middle.x * middle.y;
  float vv = squares.z / moments.x - middle.y * middle.y + STIFF;
  vec3 along_u = slope_u / moments.x - middle.x * mean;
  vec3 along_v = slope_v / moments.x - middle.y * mean;
  float determinant = max(uu * vv - uv * uv, 1e-12);
  vec3 rise_u = (vv * along_u - uv * along_v) / determinant;
  vec3 rise_v = (uu * along_v - uv * along_u) / determinant;
  vec3 found = mean - middle.x * rise_u - middle.y * rise_v;
  return clamp(found, min(0.3 * mean, 2.0 * mean), max(0.3 * mean, 2.0 * mean));  // lamps may have negative power
}

void main()
{
  out_diffuse = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  if (max_component(s.diffuse) > 0.0) {
    out_diffuse.rgb = s.diffuse * arriving_at(s.position, s.normal, s.geometric_normal);
  }
  if (s.kind == LOBE_TRANSLUCENT) {
    out_diffuse.rgb += s.glossy_weight * arriving_at(s.position, -s.normal, -s.geometric_normal);
  }
}
