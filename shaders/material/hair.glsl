// Principled Hair: what a strand scatters (lib/hair.glsl). What a fibre absorbs along a radius follows from a colour, by the fit of
// Chiang et al. 2016 for the colour of many strands together, or from pigments. `strand`, `way`, `off_axis`:
// snapshot/strands.py.
// On a mesh each triangle is a fibre along its first edge, as in Cycles: `off_axis` holds that edge, and 0 sides.
// What has neither is diffuse and lets half of its light through (shader_hair).
#include "material/shader.glsl"
#include "lib/hair.glsl"
#ifdef WIDENS_STRANDS
#include "surface/round_strand.glsl"
#endif

// Half the width that is seen of a tube of so many sides, in radii, on the side of its axis where `beside` is: out to the
// corner that is nearest to `across`. `facet`: normal of one of its sides.
float tube_width(vec3 facet, vec3 across, vec3 ahead, float beside, float sides)
{
  float step_size = 2.0 * PI / sides;
  float angle = atan(dot(facet, ahead), dot(facet, across)) - ((beside < 0.0) ? PI : 0.0) + 0.5 * step_size;
  angle -= step_size * floor(angle / step_size + 0.5);
  return PI / (sides * sin(PI / sides)) * cos(angle);
}

void shader_fibre(inout Closures closures, SurfacePoint point, vec3 weight, vec4 strand, vec4 way, vec4 off_axis,
                  vec3 color, int kind, float melanin, float redness, vec3 tint, vec3 coefficient, float roughness, float radial, float coat,
                  float ior, float offset, float random_color, float random_roughness, float random, vec3 normal)
{
  float differs = 2.0 * (((random < 0.0) ? ((strand.x < 0.5) ? 0.0 : way.w) : random) - 0.5);
  float rougher = 1.0 + differs * clamp(random_roughness, 0.0, 1.0);
  float around = clamp(radial * rougher, 0.0, 1.0);
  float along = clamp(roughness * rougher, 0.0, 1.0);
  vec3 absorption = max(coefficient, vec3(0.0));
  if (kind == 0) {
    absorption = hair_absorption(color, around);
  }
  else if (kind == 1) {
    float pigment = clamp(clamp(melanin, 0.0, 1.0) * (1.0 + differs * clamp(random_color, 0.0, 1.0)), 0.0, 1.0);
    float amount = -log(max(1.0 - pigment, 1e-4));
    absorption = amount * mix(vec3(0.506, 0.841, 1.653), vec3(0.343, 0.733, 1.924), clamp(redness, 0.0, 1.0))
                 + hair_absorption(tint, around);
  }
  vec3 n = unit_or(normal, point.normal);
  bool on_mesh = strand.x < 0.5 && off_axis.w < 0.5;
  vec3 tangent = world_from_object(point, on_mesh ? (point.backfacing ? -off_axis.xyz : off_axis.xyz) : way.xyz);
  float size = length(tangent);
  tangent /= max(size, 1e-20);
#ifdef WIDENS_STRANDS
  bool is_round = strand_is_round();  // its normal is that of a round strand already (surface/point.glsl)
#else
  bool is_round = false;
#endif
  // A tube of few sides has the normals of a round one where it is seen, by how far off its axis that is.
  vec3 across = cross(tangent, point.incoming);
  float sine = length(across);
  if (on_mesh) {
    n = point.geometric_normal;
  }
  else if (!is_round && size > 0.0 && sine > 1e-4 && dot(off_axis.xyz, off_axis.xyz) > 0.0) {
    across /= sine;
    float beside = dot(world_from_object(point, off_axis.xyz), across) / size;
    beside = clamp(beside / tube_width(point.geometric_normal, across, cross(across, tangent), beside, off_axis.w), -1.0, 1.0);
    n = beside * across + sqrt(1.0 - beside * beside) * cross(across, tangent);
  }
  vec3 upright = n - tangent * dot(n, tangent);
  if ((strand.x < 0.5 && !on_mesh) || !(size > 0.0) || !(dot(upright, upright) > 1e-8)) {
    shader_hair(closures, point, weight, color, kind, melanin, redness, tint, coefficient, around, normal);
    return;
  }
  n = octahedral_decode(octahedral_encode(normalize(upright)));  // as it will be read
  float index = clamp(ior, 1.0001, 1.0 + HAIR_IORS);
  vec3 albedo = weight * hair_albedo(hair_lobes(dot(tangent, point.incoming), hair_beside(tangent, n, point.incoming),
                                                index, absorption));
  vec3 side;
  vec3 up;
  orthonormal_basis(n, side, up);
  bool ahead = atan(dot(tangent, up), dot(tangent, side)) >= 0.0;
  float narrowing = floor(clamp(1.0 - coat, 0.0, 1.0) * HAIR_NARROWING + 0.5);
  vec3 root = vec3((index - 1.0) / HAIR_IORS, clamp(offset / HAIR_TILTS + 0.5, 0.0, 1.0),
                   (2.0 * narrowing + (ahead ? 1.0 : 0.0)) / 255.0);
  root = floor(root * 255.0 + 0.5) / 255.0;
  float thickness = on_mesh ? 0.0 : max(strand.w, 0.0) * size / max(length(way.xyz), 1e-20);
  float code = clamp(floor((log2(max(thickness, 1e-12)) + HAIR_THINNEST) * HAIR_STEPS + 0.5), 0.0, 16383.0);
  float high = floor(code / 128.0);
  closure_glossy(closures, albedo, 1.0, LOBE_TOON, root * root, vec3(0.0, high / 127.0, (code - 128.0 * high) / 127.0),
                 hair_pack(exp(-absorption)), along, around, tangent, n);
}
