// How a surface's closures are laid out in the images of the surface pass (surface.*), written and read here.
//
//   position  xyz relative to the render origin; w: 0 nothing hit, else 1 or more, see bump_encode
//   normal    octahedral shading normal of the diffuse closure (xy; of a rough one its weight in the last bits) and of the
//             triangle (zw; in the last bits smooth_lift)
//   diffuse   albedo; w: diffuse roughness, anisotropy, turn of the tangent, 8 bits each
//   tint      weight of the lobe; w: square root of its reflectance at normal incidence, 8 bits each
//   lobe      octahedral glossy normal (xy); z: kind of lobe (3 bits) and edge reflectance (7 bits each), of glass
//             what both_ways_edge says; below 0, less 1, where the edge is that of coat_encode; w: ior, below 0
//             for distributions other than GGX with multiple scattering
//   emission  radiance; w: roughness of the lobe; of a translucent one, which has none, how far below (smooth_lift)
//
// Colours stand alone in rgb so that transparent layers in front can tint them by blending (techniques/surfaces.py);
// where nothing was hit, emission holds what those layers let through.
//
// Blender's framebuffers take six colour images, hence the packing; integers up to 2^24 are exact in a float.
#include "lib/math.glsl"
#include "lib/closure.glsl"

struct Surface {
  bool hit;
  vec3 position;          // relative to the render origin
  vec3 geometric_normal;  // on the viewer's side
  vec3 normal;            // of the diffuse closure
  float lift;             // how high above its triangle a smooth surface runs, see smooth_lift
  float sink;             // and how far below it, where light shines through
  float diffuse_roughness;
  vec3 diffuse;           // albedo
  float diffuse_weight;   // of a rough one the part of it that is no colour: of a mix, or what a layer leaves
  vec3 emission;
  float holdout;
  float bump;             // how far a normal map or bump turns the diffuse closure's normal, see bump_encode
  vec3 base_normal;       // that it turns it from: of the triangle, or of the surface as it is displaced
  int kind;               // of the lobe: FRESNEL_* or LOBE_*
  vec3 glossy_weight;     // 0: no lobe
  vec3 glossy_tint;
  vec3 glossy_edge;
  float glossy_ior;
  float glossy_roughness;
  float glossy_anisotropy;
  float tangent_angle;    // of the tangent in the frame of orthonormal_basis(glossy_normal), 0..1 half turns
  vec3 glossy_normal;
  int distribution;       // of the lobe's microfacets: DISTRIBUTION_*
  bool coated;            // a thin coat lies above the lobe (surface_coat)
  vec3 coat;              // as of coat_encode
#ifdef HAS_SURFACE_EDIT
  vec4 edit;              // quaternion that turns its frame (edit/); 0: none
  bool edit_solid;        // whether the edited object is closed
  bool edit_mirrored;     // whether it is about what glass that goes both ways mirrors, not about what it bends
#endif
};

#define SURFACE_DECODED(pixel) \
  surface_decode(surface_position_fetch(pixel), surface_normal_fetch(pixel), \
                 surface_diffuse_fetch(pixel), surface_tint_fetch(pixel), \
                 surface_lobe_fetch(pixel), surface_emission_fetch(pixel))
#ifdef HAS_SURFACE_EDIT
#define SURFACE_READ(pixel) surface_edited(SURFACE_DECODED(pixel), surface_edit_fetch(pixel))
#else
#define SURFACE_READ(pixel) SURFACE_DECODED(pixel)
#endif

// Towards whom sees a surface.
#define TO_VIEWER(s) view_of_surface(s.position, s.normal)

// Alpha squared of microfacets that deviate from the normal as the bumped one does.
float bump_squared(vec3 normal, vec3 bumped)
{
  float cosine = clamp(abs(dot(normal, bumped)), 1e-3, 1.0);
  return clamp(0.125 * (1.0 / (cosine * cosine) - 1.0), 0.0, 1.0);
}

// Smith's shadowing of such microfacets, for light at this cosine from the normal.
float bump_dimming(float squared, float cosine)
{
  return 2.0 / (1.0 + sqrt(1.0 + squared * (1.0 / (cosine * cosine) - 1.0)));
}

#define BUMP_STEPS 255.0

// What w of the position holds for a surface: 1 + holdout, and the roughness of a surface of microfacets whose normals
// deviate as the bumped normal does (bump_shadowing). Where displacement has turned the normal before, fewer bits of that
// and, on a grid of BASE_STEPS x BASE_STEPS, the octahedral normal.
#define BASE_STEPS 32.0
#define BASE_BUMP_STEPS 31.0

float bump_encode(float holdout, vec3 normal, vec3 bumped, bool displaced)
{
  vec3 off = bumped - normal;
  float bump = (dot(off, off) > 1e-10) ? sqrt(bump_squared(normal, bumped)) : 0.0;
  float stored = floor(bump * BUMP_STEPS + 0.5);
  if (displaced && bump > 0.0) {
    vec2 cell = min(floor((octahedral_encode(normal) * 0.5 + 0.5) * BASE_STEPS), vec2(BASE_STEPS - 1.0));
    float few = max(floor(bump * BASE_BUMP_STEPS + 0.5), 1.0);
    stored = BUMP_STEPS + 1.0 + few + (BASE_BUMP_STEPS + 1.0) * (cell.x + BASE_STEPS * cell.y);
  }
  return 1.0 + holdout + 2.0 * stored;
}

// Numbers beside an octahedral normal: the normal stands on a grid of 2^-16, beneath whose steps 7 bits of either coordinate
// hold one of 0 to 127. Whoever reads the normal alone is 1e-5 off.
#define BESIDE_GRID 65536.0
#define BESIDE_BITS 128.0

vec2 beside_encode(vec2 octahedral, vec2 numbers)
{
  return (floor(octahedral * BESIDE_GRID + 0.5) + numbers / BESIDE_BITS) / BESIDE_GRID;
}

vec2 beside_decode(vec2 stored)
{
  return floor(fract(stored * BESIDE_GRID) * BESIDE_BITS + 0.5);
}

// A length by its logarithm.
#define LIFT_STEPS (BESIDE_BITS * BESIDE_BITS - 1.0)
#define LIFT_OCTAVES 64.0  // from 2^-40 on

vec2 lift_encode(vec2 octahedral, float lift)
{
  float code = 0.0;
  if (lift > 0.0) {
    code = clamp(floor((log2(lift) + 40.0) * (LIFT_STEPS / LIFT_OCTAVES) + 0.5), 1.0, LIFT_STEPS);
  }
  float high = floor(code / BESIDE_BITS);
  return beside_encode(octahedral, vec2(high, code - high * BESIDE_BITS));
}

float lift_decode(vec2 stored)
{
  vec2 numbers = beside_decode(stored);
  float code = numbers.x * BESIDE_BITS + numbers.y;
  return (code > 0.0) ? exp2(code * (LIFT_OCTAVES / LIFT_STEPS) - 40.0) : 0.0;
}

// The diffuse closure's normal, and its weight where that matters. Several added up may weigh more than 1.
#define WEIGHT_STEPS 64.0

vec2 diffuse_normal_encode(vec3 normal, float weight, float roughness)
{
  float code = clamp(floor(weight * WEIGHT_STEPS + 0.5), 1.0, BESIDE_BITS - 1.0);
  vec2 octahedral = octahedral_encode(normal);
  return (roughness > 0.0) ? beside_encode(octahedral, vec2(code, 0.0)) : octahedral;
}

float diffuse_weight_decode(vec2 stored, float roughness)
{
  return (roughness > 0.0) ? max(beside_decode(stored).x, 1.0) / WEIGHT_STEPS : 1.0;
}

// Three numbers in 0..1 in one float, `steps` + 1 levels each; and back.
float pack_three(vec3 v, float steps)
{
  vec3 level = floor(clamp(v, vec3(0.0), vec3(1.0)) * steps + 0.5);
  return level.x + (steps + 1.0) * (level.y + (steps + 1.0) * level.z);
}

vec3 unpack_three(float packed_value, float steps)
{
  float n = steps + 1.0;
  float z = floor(packed_value / (n * n));
  float y = floor((packed_value - z * n * n) / n);
  return vec3(packed_value - n * (y + n * z), y, z) / steps;
}

// The share of a tint that is stored: of what the index of refraction gives, for dielectrics.
vec3 stored_tint_scale(int kind, float ior)
{
  return vec3((kind == FRESNEL_DIELECTRIC || kind == LOBE_REFRACTION) ? dielectric_f0(ior) : 1.0);
}

// The lobe's weight and packed tint. Where reflectance is about weight x tint, what the tint loses in eight bits goes
// into the weight, so that the product is exact.
vec4 tint_encode(int kind, vec3 weight, vec3 tint, float ior)
{
  vec3 share = tint / max(stored_tint_scale(kind, ior), vec3(1e-20));
  vec3 root = floor(sqrt(clamp(share, vec3(0.0), vec3(1.0))) * 255.0 + 0.5) / 255.0;
  if (kind != FRESNEL_DIELECTRIC && kind != LOBE_REFRACTION) {
    weight.x *= (root.x > 0.0) ? share.x / (root.x * root.x) : 1.0;
    weight.y *= (root.y > 0.0) ? share.y / (root.y * root.y) : 1.0;
    weight.z *= (root.z > 0.0) ? share.z / (root.z * root.z) : 1.0;
  }
  return vec4(weight, pack_three(root, 255.0));
}

// The lobe's index of refraction and distribution in one float: those whose reflectance depends on the index are GGX.
#define OTHER_DISTRIBUTION 4e5  // above any index

float ior_encode(float ior, int distribution)
{
  float other = -OTHER_DISTRIBUTION * (float(distribution) + 0.5);
  return (distribution == DISTRIBUTION_MULTI_GGX) ? ior : ((distribution == DISTRIBUTION_GGX) ? -ior : other);
}

// Whether a lobe without microfacets belongs to the glossy passes.
bool soft_lobe_is_glossy(Surface s)
{
  return s.kind == LOBE_VELVET || (s.kind == LOBE_TOON && s.glossy_edge.x > 0.5);
}

// Whether a surface has a lobe without microfacets that belongs to the diffuse passes.
bool has_diffuse_lobe(Surface s)
{
  return max_component(s.glossy_weight) > 0.0 && s.kind > LOBE_REFRACTION && !soft_lobe_is_glossy(s);
}

// Whether a surface's lobe is that of a fibre (lib/hair.glsl).
bool is_fibre(Surface s)
{
  return s.kind == LOBE_TOON && s.glossy_tint.z < 0.9;
}

// Colour of all that a surface adds to the diffuse passes.
vec3 diffuse_color(Surface s)
{
  return max(s.diffuse, vec3(0.0)) + (has_diffuse_lobe(s) ? s.glossy_weight : vec3(0.0));
}

// Kind and edge of a lobe, without what says that it has a coat.
float lobe_code(vec4 lobe)
{
  return (lobe.z < 0.0) ? -lobe.z - 1.0 : lobe.z;
}

int lobe_kind(vec4 lobe)
{
  return int(floor(lobe_code(lobe) / 2097152.0));
}

Surface surface_decode(vec4 position, vec4 normal, vec4 diffuse, vec4 tint, vec4 lobe, vec4 emission)
{
  Surface s;
  s.hit = position.w != 0.0;
  s.position = position.xyz;
  float stored = floor((position.w - 1.0) * 0.5);
  s.holdout = position.w - 1.0 - 2.0 * stored;
  s.normal = octahedral_decode(normal.xy);
  s.geometric_normal = octahedral_decode(normal.zw);
  s.bump = stored / BUMP_STEPS;
  s.lift = lift_decode(normal.zw);
  s.base_normal = s.geometric_normal;
  if (stored > BUMP_STEPS) {
    float code = floor((stored - BUMP_STEPS - 1.0) / (BASE_BUMP_STEPS + 1.0));
    s.bump = (stored - BUMP_STEPS - 1.0 - (BASE_BUMP_STEPS + 1.0) * code) / BASE_BUMP_STEPS;
    float row = floor(code / BASE_STEPS);
    s.base_normal = octahedral_decode((vec2(code - BASE_STEPS * row, row) + 0.5) * (2.0 / BASE_STEPS) - 1.0);
  }
  s.diffuse = diffuse.xyz;
  vec3 shape = unpack_three(diffuse.w, 255.0);
  s.diffuse_roughness = shape.x;
  s.diffuse_weight = diffuse_weight_decode(normal.xy, shape.x);
  s.glossy_anisotropy = shape.y;
  s.tangent_angle = shape.z;
  s.glossy_weight = tint.xyz;
  s.glossy_normal = octahedral_decode(lobe.xy);
  s.kind = lobe_kind(lobe);
  s.coated = lobe.z < 0.0;
  s.coat = unpack_three(lobe_code(lobe) - float(s.kind) * 2097152.0, 127.0);
  s.glossy_edge = s.coated ? vec3(1.0) : s.coat;
  s.glossy_ior = abs(lobe.w);
  s.distribution = (lobe.w < 0.0) ? int(s.glossy_ior / OTHER_DISTRIBUTION) : DISTRIBUTION_MULTI_GGX;
  s.glossy_ior = (s.distribution > DISTRIBUTION_MULTI_GGX) ? 1.5 : s.glossy_ior;
  vec3 root = unpack_three(tint.w, 255.0);
  s.glossy_tint = root * root * stored_tint_scale(s.kind, s.glossy_ior);
  s.emission = emission.xyz;
  s.glossy_roughness = (s.kind == LOBE_TRANSLUCENT) ? 1.0 : emission.w;
  s.sink = (s.kind == LOBE_TRANSLUCENT) ? emission.w : 0.0;
#ifdef HAS_SURFACE_EDIT
  s.edit = vec4(0.0);
  s.edit_solid = false;
  s.edit_mirrored = false;
#endif
  return s;
}

#ifdef HAS_SURFACE_EDIT
// `edit`: a quaternion, twice as long where it is that of a closed object, and longer by 2 where glass that bends light
// has one of what it mirrors; 0: none.
Surface surface_edited(Surface s, vec4 edit)
{
  float size = length(edit);
  s.edit = (size > 0.0) ? edit / size : vec4(0.0);
  s.edit_mirrored = size > 2.5;
  s.edit_solid = (s.edit_mirrored ? size - 2.0 : size) > 1.5;
  return s;
}
#endif

bool surface_is_edited(Surface s)
{
#ifdef HAS_SURFACE_EDIT
  return dot(s.edit, s.edit) > 0.0 && !(s.edit_mirrored && s.kind == LOBE_REFRACTION);
#else
  return false;
#endif
}

// Whether an edit turns light where it leaves the glass, whose other side shows it: that of a closed object.
bool edits_what_leaves(Surface s)
{
#ifdef HAS_SURFACE_EDIT
  return s.kind == LOBE_REFRACTION && s.edit_solid && surface_is_edited(s);
#else
  return false;
#endif
}

// Whether the lobe is of glass that mirrors, too (both_ways_edge).
bool surface_goes_both_ways(Surface s)
{
  return s.kind == LOBE_REFRACTION && s.glossy_edge.x > 0.6 && s.glossy_edge.x < 0.95;
}

// The surface with what such glass mirrors as its lobe; others as they are.
Surface surface_mirrored(Surface s)
{
  if (surface_goes_both_ways(s)) {
    float code = floor(s.glossy_edge.y * 127.0 + 0.5) * 128.0 + floor(s.glossy_edge.z * 127.0 + 0.5);
    float share = code * (BOTH_MOST / BOTH_STEPS);
    s.glossy_weight = share * ((s.glossy_edge.x > 0.82) ? vec3(max_component(s.glossy_weight)) : s.glossy_weight);
    s.kind = FRESNEL_DIELECTRIC;
    s.glossy_edge = GLASS_EDGE;
#ifdef HAS_SURFACE_EDIT
    s.edit *= float(s.edit_mirrored);
#endif
  }
  return s;
}

// Whether the lobe is what glass mirrors, from either side.
bool surface_is_mirror_of_glass(Surface s)
{
  return s.kind == FRESNEL_DIELECTRIC && s.glossy_edge.x < 0.5;
}

// The surface with its coat as its lobe, where it is coated.
Surface surface_coat(Surface s)
{
  float code = floor(s.coat.x * 127.0 + 0.5);
  float index = floor(code / COAT_ROUGHNESSES);
  float share = floor(s.coat.y * 127.0 + 0.5) * 128.0 + floor(s.coat.z * 127.0 + 0.5);
  s.glossy_weight = vec3(share * (COAT_MOST / BOTH_STEPS) * max_component(s.glossy_weight));
  s.kind = FRESNEL_DIELECTRIC;
  s.glossy_edge = vec3(1.0);
  s.glossy_ior = COAT_IOR_LEAST + COAT_IOR_STEP * index;
  s.glossy_tint = vec3(dielectric_f0(s.glossy_ior));
  s.glossy_roughness = COAT_ROUGHNESS_STEP * (code - COAT_ROUGHNESSES * index);
  s.glossy_anisotropy = 0.0;
  s.distribution = DISTRIBUTION_MULTI_GGX;
  s.coated = false;
  return s;
}

// Whether what comes from `direction` may be mirrored: from above the triangle, or where an edit has turned it.
bool may_mirror(Surface s, vec3 direction)
{
  return dot(direction, s.geometric_normal) > 0.0 || surface_is_edited(s);
}

// Whether an edit sends a mirrored ray into the object itself. It shows its surroundings then: rays begin where they leave it.
bool enters_itself(Surface s, vec3 direction)
{
#ifdef HAS_SURFACE_EDIT
  return s.edit_solid && dot(direction, s.geometric_normal) < 0.0;
#else
  return false;
#endif
}

// The side of the triangle on which a ray along `direction` starts: edits may turn it below.
vec3 side_of_ray(Surface s, vec3 direction)
{
  return (surface_is_edited(s) && dot(direction, s.geometric_normal) < 0.0) ? -s.geometric_normal : s.geometric_normal;
}
