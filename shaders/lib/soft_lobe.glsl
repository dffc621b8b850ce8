// Lobes without microfacets: microfiber sheen, Ashikhmin's velvet, diffuse transmission, toon, hair. Wide enough that light
// samples serve them, so no ray is drawn from them.
//
// Sheen: Zeltner, Burley & Chiang, "Practical multiple-scattering sheen using linearly transformed cosines", 2022.
// Velvet: Ashikhmin, Premoze & Shirley, "A microfacet-based BRDF generator", 2000. Toon: constant within a cone.
#include "lib/math.glsl"
#include "lib/energy.glsl"
#include "lib/gbuffer.glsl"
#include "lib/hair.glsl"

struct SoftLobe {
  bool exists;
  int kind;
  bool glossy;    // belongs to the glossy passes
  vec3 weight;    // its albedo as Cycles counts it in the colour passes
  vec2 shape;     // sheen: a, b of the map; velvet: 1 / spread^2; toon: lit angle and angle of the fall-off, radians
  vec3 view;
  vec3 normal;
  vec3 tangent;   // sheen: towards the viewer; toon: the axis of the cone
  vec3 base;      // the surface's normal without the shader's own bump
  float bump;     // alpha squared of microfacets that deviate as `normal` does from it
  bool fibre;     // hair: `tangent` is its way, `shape` its roughness along and around
  HairLobes hair;
  vec2 scales;    // tilt, narrowing of the first lobe
  float radius;   // of the fibre
};

// Decodes what lib/hair.glsl says of a fibre.
void soft_fibre(inout SoftLobe lobe, Surface s)
{
  vec3 root = sqrt(s.glossy_tint);
  float level = floor(root.z * 255.0 + 0.5);
  float narrowing = floor(0.5 * level);
  vec3 side;
  vec3 up;
  orthonormal_basis(s.glossy_normal, side, up);
  float angle = PI * s.tangent_angle;
  lobe.tangent = (cos(angle) * side + sin(angle) * up) * ((level > 2.0 * narrowing + 0.5) ? 1.0 : -1.0);
  lobe.shape = vec2(s.glossy_roughness, s.glossy_anisotropy);
  lobe.scales = vec2((root.y - 0.5) * HAIR_TILTS, narrowing / HAIR_NARROWING);
  lobe.radius = hair_radius(s.glossy_edge);
  vec3 absorption = -log(max(hair_unpack(s.glossy_ior), vec3(1e-6)));
  lobe.hair = hair_lobes(dot(lobe.tangent, lobe.view), hair_beside(lobe.tangent, lobe.normal, lobe.view),
                         1.0 + HAIR_IORS * root.x, absorption);
  lobe.weight /= max(hair_albedo(lobe.hair), vec3(1e-6));
  lobe.bump = 0.0;
}

SoftLobe soft_lobe_begin(Surface s, vec3 view)
{
  SoftLobe lobe;
  lobe.exists = s.kind > LOBE_REFRACTION && max_component(s.glossy_weight) > 0.0;
  lobe.kind = s.kind;
  lobe.glossy = soft_lobe_is_glossy(s);
  lobe.weight = s.glossy_weight;
  lobe.shape = vec2(1.0, 0.0);
  lobe.view = view;
  lobe.normal = s.glossy_normal;
  lobe.tangent = s.glossy_normal;
  lobe.base = (s.bump > 0.0) ? s.base_normal : s.normal;
  lobe.bump = 0.0;
  lobe.fibre = false;
  if (!lobe.exists) {
    return lobe;
  }
  vec3 off = lobe.normal - lobe.base;
  lobe.bump = (dot(off, off) > 1e-8) ? bump_squared(lobe.base, lobe.normal) : 0.0;
  float mu = dot(lobe.normal, view);
  if (s.kind == LOBE_SHEEN) {
    vec3 terms = sheen_terms(mu, s.glossy_roughness);
    lobe.shape = vec2(max(terms.x, 1e-5), terms.y);
    vec3 side = view - mu * lobe.normal;
    vec3 otherwise;
    orthonormal_basis(lobe.normal, lobe.tangent, otherwise);
    lobe.tangent = (dot(side, side) > 1e-12) ? normalize(side) : lobe.tangent;
  }
  else if (s.kind == LOBE_VELVET) {
    float spread = max(s.glossy_roughness, 0.01);
    lobe.shape = vec2(1.0 / (spread * spread), 0.0);
  }
  else if (is_fibre(s)) {
    lobe.fibre = true;
    soft_fibre(lobe, s);
  }
  else if (s.kind == LOBE_TOON) {
    lobe.shape = 0.5 * PI * vec2(s.glossy_roughness, s.glossy_anisotropy);
    lobe.tangent = lobe.glossy ? 2.0 * mu * lobe.normal - view : lobe.normal;
  }
  return lobe;
}

float velvet_reflection(SoftLobe lobe, vec3 light)
{
  float nl = dot(lobe.normal, light);
  float nv = dot(lobe.normal, lobe.view);
  vec3 h = safe_normalize(light + lobe.view);
  float nh = dot(lobe.normal, h);
  float hv = abs(dot(lobe.view, h));
  if (nl <= 0.0 || nv <= 0.0 || abs(nh) >= 1.0 - 1e-5 || hv <= 1e-5) {
    return 0.0;
  }
  float sin_squared = 1.0 - nh * nh;
  float fibers = exp(-nh * nh / sin_squared * lobe.shape.x) * lobe.shape.x / (PI * sin_squared * sin_squared);
  float shadowing = min(1.0, 2.0 * max(nh / hv, 1e-5) * min(nv, nl));
  return 0.25 * fibers * shadowing / nv;
}

float toon_reflection(SoftLobe lobe, vec3 light)
{
  if (dot(lobe.normal, light) <= 0.0) {
    return 0.0;
  }
  float angle = acos(clamp(dot(lobe.tangent, light), 0.0, 1.0));
  float inner = lobe.shape.x;
  float outer = min(inner + lobe.shape.y, 0.5 * PI);
  if (angle >= inner + lobe.shape.y && angle > inner) {
    return 0.0;
  }
  float shade = (angle <= inner) ? 1.0 : 1.0 - (angle - inner) / lobe.shape.y;
  return shade / (2.0 * PI * max(1.0 - cos(outer), 1e-6));
}

// Whether a fibre is a triangle of a mesh, which is flat and has two sides.
bool fibre_is_flat(SoftLobe lobe)
{
  return lobe.radius < HAIR_FLAT;
}

// As bump_shadowing (lib/brdf.glsl): nothing passes between a surface and its own bumps, and what is diffuse is dimmed.
// Cycles takes the direction across view and fibre for a bumped normal of fibres on meshes.
float soft_bump_shadowing(SoftLobe lobe, vec3 light)
{
  if (lobe.fibre && fibre_is_flat(lobe)) {
    vec3 across = cross(lobe.tangent, lobe.view);
    return (dot(across, light) * dot(lobe.normal, light) * dot(across, lobe.normal) < 0.0) ? 0.0 : 1.0;
  }
  if (lobe.bump <= 0.0) {
    return 1.0;
  }
  float cosine = dot(lobe.base, light);
  if (cosine * dot(lobe.normal, light) <= 0.0) {
    return 0.0;
  }
  return lobe.glossy ? 1.0 : bump_dimming(lobe.bump, max(abs(cosine), 1e-6));
}

// f * cos for a light direction in world space, without bumps.
vec3 soft_shape(SoftLobe lobe, vec3 light)
{
  if (lobe.fibre) {
    return lobe.weight * hair_scattering(lobe.hair, lobe.tangent, lobe.view, light, lobe.shape, lobe.scales.x, lobe.scales.y);
  }
  float z = dot(lobe.normal, light);
  if (lobe.kind == LOBE_SHEEN) {
    vec3 bitangent = cross(lobe.normal, lobe.tangent);
    vec3 mapped = vec3(lobe.shape.x * dot(lobe.tangent, light) + lobe.shape.y * z,
                       lobe.shape.x * dot(bitangent, light), z);
    float narrowing = lobe.shape.x / max(dot(mapped, mapped), 1e-20);
    return lobe.weight * (max(z, 0.0) / PI * narrowing * narrowing);
  }
  if (lobe.kind == LOBE_VELVET) {
    return lobe.weight * velvet_reflection(lobe, light);
  }
  if (lobe.kind == LOBE_TRANSLUCENT) {
    return lobe.weight * (max(-z, 0.0) / PI);
  }
  return lobe.weight * toon_reflection(lobe, light);
}

// A direction that a fibre takes light from; `weight`: f * cos over its density.
vec3 fibre_sample(SoftLobe lobe, vec4 u, out vec3 weight)
{
  vec3 direction = hair_sample(lobe.hair, lobe.tangent, lobe.view, lobe.shape, lobe.scales.x, lobe.scales.y, u, weight);
  weight *= lobe.weight;
  return direction;
}

// Where a ray along `direction` leaves a fibre, which does not shadow itself: on the far side for light that shines through.
// `facing`: the fibre's normal there.
#define FIBRE_CLEAR 1.15  // radii: beyond the corners of a tube of few sides

vec3 fibre_start(SoftLobe lobe, vec3 position, vec3 direction, out vec3 facing)
{
  vec3 across = direction - lobe.tangent * dot(direction, lobe.tangent);
  facing = (dot(across, across) > 1e-12) ? normalize(across) : lobe.normal;
  if (fibre_is_flat(lobe)) {
    facing = (dot(direction, lobe.normal) < 0.0) ? -lobe.normal : lobe.normal;
  }
  return position + (facing * FIBRE_CLEAR - lobe.normal) * lobe.radius;
}

// f * cos for a light direction in world space.
vec3 soft_reflection(SoftLobe lobe, vec3 light)
{
  return soft_shape(lobe, light) * soft_bump_shadowing(lobe, light);
}
