// Closures: what a surface point does with light, collected while the material graph is walked.
// Diffuse weights add up where normal and roughness are the same. Of those that differ, and of several other lobes (glossy,
// refraction, sheen, translucent, toon), one is kept per sample with probability by its weight (reservoir sampling) and
// carries all of their weight, so they stay apart and the mean is exact.
#include "lib/math.glsl"
#include "lib/surface_point.glsl"

// Kinds of the lobe that is kept. Microfacets differ in their Fresnel term:
#define FRESNEL_NONE 0        // reflectance = tint
#define FRESNEL_DIELECTRIC 1  // reflectance runs from tint at normal incidence to 1, with the shape given by ior
#define FRESNEL_F82 2         // metal: tint at normal incidence, edge at 82 degrees
// What a rough dielectric lets through (lib/refraction.glsl): tint is what it reflects at normal incidence, ior that of
// the far side over the near one, edge 1 with Fresnel's losses and 0 without:
#define LOBE_REFRACTION 3
// Lobes without microfacets, evaluated in lib/soft_lobe.glsl; all of their colour is in the weight:
#define LOBE_SHEEN 4          // microfiber
#define LOBE_VELVET 5         // fibres after Ashikhmin; roughness is the spread of their normals
#define LOBE_TRANSLUCENT 6    // diffuse, lit from the other side
#define LOBE_TOON 7           // roughness: size, anisotropy: smoothness; edge 1: around the mirror direction
// No lobe, weight 0; what its numbers in the surface images are then: grass/surface.glsl.
#define SURFACE_GRASS 8


// Smooth glass may be kept as one lobe that lets through and mirrors: a LOBE_REFRACTION whose edge says how much it
// mirrors beside, in shares of its weight. x, above the 0.5 that tells Fresnel's losses: 1 nothing, BOTH_COLORED by its
// colour, BOTH_GREY by the largest channel; y, z: high and low part of the share.
#define BOTH_COLORED (96.0 / 127.0)
#define BOTH_GREY (112.0 / 127.0)
#define BOTH_STEPS 16383.0
#define BOTH_MOST 4.0        // the largest share
#define BOTH_ROUGHNESS 0.6   // of glass that is kept so

// What glass mirrors, kept as a lobe of its own, has this edge; other dielectrics white.
#define GLASS_EDGE vec3(0.0)

vec3 both_ways_edge(float share, bool colored)
{
  float code = floor(clamp(share / BOTH_MOST, 0.0, 1.0) * BOTH_STEPS + 0.5);
  float high = floor(code / 128.0);
  return vec3(colored ? BOTH_COLORED : BOTH_GREY, high / 127.0, (code - 128.0 * high) / 127.0);
}

// A thin clear coat may be kept beside the lobe below it, so that no sample lacks either of the two: in the numbers of that
// one's edge, where it is white. x: roughness and index, in steps; y, z: high and low part of the coat's weight, in shares
// of the lobe's.
#define COAT_ROUGHNESS_STEP 0.01
#define COAT_ROUGHNESSES 16.0
#define COAT_IOR_LEAST 1.3
#define COAT_IOR_STEP 0.05
#define COAT_IORS 8.0
#define COAT_MOST 8.0  // the largest share

bool coat_is_thin(float roughness, float ior)
{
  float place = (ior - COAT_IOR_LEAST) / COAT_IOR_STEP;
  bool known = abs(place - floor(place + 0.5)) < 0.02 && place > -0.5 && place < COAT_IORS - 0.5;
  return known && roughness < (COAT_ROUGHNESSES - 0.5) * COAT_ROUGHNESS_STEP;
}

vec3 coat_encode(float share, float roughness, float ior)
{
  float rough = floor(roughness / COAT_ROUGHNESS_STEP + 0.5);
  float index = floor((ior - COAT_IOR_LEAST) / COAT_IOR_STEP + 0.5);
  float code = floor(clamp(share / COAT_MOST, 0.0, 1.0) * BOTH_STEPS + 0.5);
  float high = floor(code / 128.0);
  return vec3(rough + COAT_ROUGHNESSES * index, high, code - 128.0 * high) / 127.0;
}

float dielectric_f0(float ior)
{
  float root = (ior - 1.0) / (ior + 1.0);
  return root * root;
}

// Unpolarised reflectance of a smooth dielectric; ior is inside over outside, total reflection gives 1.
float fresnel_dielectric(float cos_h, float ior)
{
  float c = abs(cos_h);
  float g_squared = ior * ior - 1.0 + c * c;
  if (g_squared <= 0.0) {
    return 1.0;
  }
  float g = sqrt(g_squared);
  float a = (g - c) / max(g + c, 1e-20);
  float b = ((g + c) * c - 1.0) / ((g - c) * c + 1.0);
  return 0.5 * a * a * (1.0 + b * b);
}

// Mean reflectance of a dielectric over the hemisphere, cosine-weighted: rational fit for ior >= 1 and cubic below.
float fresnel_average_dielectric(float ior)
{
  if (ior >= 1.0) {
    return (ior - 1.0) / (4.08567 + 1.00071 * ior);
  }
  return 0.997118 + ior * (0.1014 - ior * (0.965241 + 0.130607 * ior));
}

// Of microfacets. All are evaluated with multiple scattering, which the weight of all but the first takes out again.
#define DISTRIBUTION_GGX 0
#define DISTRIBUTION_MULTI_GGX 1
#define DISTRIBUTION_BECKMANN 2
#define DISTRIBUTION_ASHIKHMIN_SHIRLEY 3

// Half widths of the lobe (alpha) along tangent and bitangent. Anisotropy is 1 - sqrt of their ratio, as that of the
// Glossy node is.
vec2 lobe_alpha(float roughness, float anisotropy)
{
  float alpha = roughness * roughness;
  float narrow = 1.0 - clamp(anisotropy, 0.0, 0.99);
  return clamp(vec2(alpha / narrow, alpha * narrow), vec2(0.0), vec2(1.0));
}

// Roughness of the round lobe that is as wide: energy and albedo are those of this one.
float lobe_roughness(vec2 alpha)
{
  return sqrt(sqrt(alpha.x * alpha.y));
}

struct Closures {
  vec3 base_normal;       // of the surface as it is displaced, before a shader's own normal bumps it
  vec3 diffuse;           // albedo
  float diffuse_weight;   // the part of it that is no colour: of a mix, or what a layer leaves
  float diffuse_roughness;
  vec3 diffuse_normal;
  float diffuse_sum;      // reservoir state
  float diffuse_kept;
  bool diffuse_apart;     // closures of several normals or roughnesses
  vec3 emission;          // radiance
  vec3 transparency;      // fraction that passes straight through
  float holdout;
  int kind;               // of the lobe that is kept: FRESNEL_* or LOBE_*
  vec3 glossy_weight;     // multiplies the whole lobe
  vec3 glossy_tint;       // see FRESNEL_*
  vec3 glossy_edge;       // of F82; of dielectrics: GLASS_EDGE
  float glossy_ior;
  float glossy_roughness; // alpha = roughness^2
  float glossy_anisotropy; // see lobe_alpha
  vec3 glossy_tangent;
  vec3 glossy_normal;
  int distribution;       // of the lobe's microfacets: DISTRIBUTION_*
  vec4 coat;              // beside that lobe (coat_encode): weight, roughness, ior, importance; 0: none
  vec3 coat_normal;
  float glossy_sum;       // reservoir state
  float glossy_count;
  float glossy_chance;    // that the lobe that is kept was to be
  float even_share;       // of that chance, which all lobes have alike
  float random;           // uniform 0..1, reused by rescaling
#ifdef PATH_COLOR
  vec3 path;              // what the path that came here lets pass, up to a factor: what it lacks no lobe can bring
#endif
#ifdef SUBSURFACE
  vec3 scatter;           // of the diffuse albedo, the part whose light entered elsewhere
  vec3 scatter_length;    // SCATTER_* length of its profile, m, times the albedo
  vec3 scatter_color;     // albedo that decides the profile's shape, times the albedo
  float scatter_most;     // albedo of the one that the next two are of
  int scatter_method;     // SCATTER_*
  float scatter_entry;    // cosine at which the view's ray enters
  float scatter_alpha;    // roughness of the interface there, squared, and its index of refraction
  float scatter_ior;
  float map_length;       // painted: factor of the length
  vec4 map_entry;         // painted: tint of light that enters, and how much of it scatters
#endif
};

// Cycles' methods of subsurface scattering; what a length is: Burley's d, else the mean free path of an isotropic walk.
#define SCATTER_BURLEY 0
#define SCATTER_WALK 1
#define SCATTER_SKIN 2

// `even_share`: of a lobe's chance to be kept, which all lobes have alike. Without, a faint lobe beside a strong one would be
// kept in one sample of hundreds, and its own pass, and the highlights of lamps in it, would be noise.
Closures closures_begin(vec3 normal, float random_number, float even_share)
{
  Closures c;
  c.base_normal = normal;
  c.diffuse = vec3(0.0);
  c.diffuse_weight = 0.0;
  c.diffuse_roughness = 0.0;
  c.diffuse_normal = normal;
  c.diffuse_sum = 0.0;
  c.diffuse_kept = 0.0;
  c.diffuse_apart = false;
  c.emission = vec3(0.0);
  c.transparency = vec3(0.0);
  c.holdout = 0.0;
  c.kind = FRESNEL_NONE;
  c.glossy_weight = vec3(0.0);
  c.glossy_tint = vec3(0.0);
  c.glossy_edge = vec3(1.0);
  c.glossy_ior = 1.5;
  c.glossy_roughness = 1.0;
  c.glossy_anisotropy = 0.0;
  c.glossy_tangent = vec3(0.0);
  c.glossy_normal = normal;
  c.distribution = DISTRIBUTION_MULTI_GGX;
  c.coat = vec4(0.0);
  c.coat_normal = normal;
  c.glossy_sum = 0.0;
  c.glossy_count = 0.0;
  c.glossy_chance = 1.0;
  c.even_share = even_share;
  c.random = random_number;
#ifdef PATH_COLOR
  c.path = vec3(1.0);
#endif
#ifdef SUBSURFACE
  c.scatter = vec3(0.0);
  c.scatter_length = vec3(0.0);
  c.scatter_color = vec3(0.0);
  c.scatter_most = 0.0;
  c.scatter_method = SCATTER_BURLEY;
  c.scatter_entry = 1.0;
  c.scatter_alpha = 1.0;
  c.scatter_ior = 1.0;
  c.map_length = 1.0;
  c.map_entry = vec4(1.0);
#endif
  return c;
}

// Of a lobe's colour what the path has a use for: chances are in proportion to that.
vec3 useful_color(Closures c, vec3 color)
{
#ifdef PATH_COLOR
  return c.path * color;
#else
  return color;
#endif
}

// Closures with one normal and roughness add up. Of others one is kept with all of their weight, so that the mean is exact.
void closure_diffuse(inout Closures c, vec3 weight, vec3 color, float roughness, vec3 normal)
{
  vec3 albedo = weight * color;
  // Weights near the end of float32 add up to infinity, of which there is no share.
  float added = min(dot(useful_color(c, albedo), vec3(1.0)), 1e30);
  bool below = dot(normal, c.base_normal) < 0.0;  // a map has turned it there, where in Cycles no light reaches it
#ifdef SUBSURFACE
  below = below && dot(c.scatter, vec3(1.0)) == 0.0;
#endif
  if (!(added > 0.0) || below) {
    return;
  }
  float total = min(c.diffuse_sum + added, 1e30);
  float share = added / total;
  bool alike = abs(roughness - c.diffuse_roughness) < 1e-3 && dot(normal, c.diffuse_normal) > 0.9999;
  if (c.diffuse_sum > 0.0 && (c.diffuse_apart || !alike)) {
    c.diffuse_apart = true;
    if (c.random < share) {
      c.diffuse_kept = 0.0;
      c.diffuse = vec3(0.0);
      c.diffuse_weight = 0.0;
    }
    c.random = (c.random < share) ? c.random / share : (c.random - share) / max(1.0 - share, 1e-7);
    c.random = min(c.random, 0.9999999);
  }
  c.diffuse_sum = total;
  if (!c.diffuse_apart || c.diffuse_kept == 0.0) {
    c.diffuse += albedo;
    c.diffuse_kept += added;
    c.diffuse_weight = min(c.diffuse_weight + max(max(weight.x, weight.y), weight.z), 1e30);
    c.diffuse_roughness = roughness;
    c.diffuse_normal = normal;
  }
}

// True if this lobe replaces the one that is kept; the caller then fills in the lobe.
// `importance` estimates the lobe's albedo and only steers noise.
bool closure_glossy_choose(inout Closures c, vec3 weight, float importance)
{
  vec3 useful = useful_color(c, weight);
  float w = max(max(useful.x, useful.y), useful.z) * max(importance, 1e-4);
  if (!(w > 0.0)) {
    return false;
  }
  c.glossy_sum += w;
  c.glossy_count += 1.0;
  float p = mix(w / c.glossy_sum, 1.0 / c.glossy_count, c.even_share);
  if (c.random < p) {
    c.random = min(c.random / p, 0.9999999);
    c.glossy_chance = p;
    return true;
  }
  c.glossy_chance *= 1.0 - p;
  c.random = min((c.random - p) / max(1.0 - p, 1e-7), 0.9999999);
  return false;
}

// True if this lobe is the one that is kept so far.
bool closure_glossy(inout Closures c, vec3 weight, float importance, int kind, vec3 tint, vec3 edge, float ior,
                    float roughness, float anisotropy, vec3 tangent, vec3 normal)
{
#ifdef ONE_LOBE
  // Of a light that meets the surface: what is bent (1) or mirrored (2) alone, so that all photons take one path.
  if (kind > LOBE_REFRACTION || (kind == LOBE_REFRACTION) != (wanted_lobe == 1)) {
    return false;
  }
#endif
  bool chosen = closure_glossy_choose(c, weight, importance);
  if (chosen) {
    c.kind = kind;
    c.glossy_weight = weight;  // to be divided by the chance of it in closures_end, when that is final
    c.glossy_tint = tint;
    c.glossy_edge = edge;
    c.glossy_ior = ior;
    c.glossy_roughness = roughness;
    c.glossy_anisotropy = anisotropy;
    c.glossy_tangent = tangent;
    c.glossy_normal = normal;
    c.distribution = DISTRIBUTION_MULTI_GGX;
  }
  return chosen;
}

void closure_emission(inout Closures c, vec3 radiance)
{
  c.emission += radiance;
}

void closure_transparent(inout Closures c, vec3 weight)
{
  c.transparency += weight;
}

// 0 for a colour that is no number: node math may overflow or divide by zero. Cycles drops such light, too.
vec3 finite_or_black(vec3 color)
{
  return (is_finite(color.x) && is_finite(color.y) && is_finite(color.z)) ? color : vec3(0.0);
}

// The chance with which a layer lets the rays of a sample pass, and the share of the light that does, grey. Where a lobe is
// added to what lets all pass both are more than 1 together: the layer is then drawn as often as they are to each other,
// and who passes it carries the more light (LEAST_DRAWN: of a faint lobe too, or its highlights were few and bright).
// `colored`: what passes is given the layer's colour over this chance. A layer that has no more than that lets all pass.
#define LEAST_DRAWN 0.25

float layer_share(Closures c)
{
  return clamp(dot(c.transparency, vec3(1.0 / 3.0)), 0.0, 1.0);
}

float layer_chance(Closures c, bool colored)
{
  float through = layer_share(c);
#if defined(LAYER_COLORS) && !defined(OWN_CLOSURES)
  if (colored && through > 0.0 && c.diffuse_sum + c.glossy_sum + c.holdout <= 0.0) {
    return 1.0;
  }
#endif
#ifdef ADDED_LOBES
  float drawn = c.diffuse_sum / 3.0 + c.glossy_sum;
  if (drawn > 0.0 && through + drawn > 1.001) {
    through /= through + max(drawn, LEAST_DRAWN);
  }
#endif
  return through;
}

// The coat stays beside the lobe that is kept, where that leaves room for it; else it is one lobe more to choose from.
void coat_end(inout Closures c)
{
  vec4 coat = c.coat;
  bool white = c.kind != FRESNEL_F82 || min(min(c.glossy_edge.x, c.glossy_edge.y), c.glossy_edge.z) > 0.997;
  vec3 kept = finite_or_black(c.glossy_weight / max(c.glossy_chance, 1e-30));
  float share = coat.x / max(max(max(kept.x, kept.y), kept.z), 1e-30);
  if (c.kind <= FRESNEL_F82 && white && share < COAT_MOST && dot(c.coat_normal, c.glossy_normal) > 0.9999) {
    return;
  }
  c.coat = vec4(0.0);
  closure_glossy(c, vec3(coat.x), coat.w, FRESNEL_DIELECTRIC, vec3(dielectric_f0(coat.z)), vec3(1.0), coat.z, coat.y, 0.0,
                 vec3(0.0), c.coat_normal);
}

void closures_end(inout Closures c)
{
  if (c.coat.x > 0.0) {
    coat_end(c);
  }
  if (c.diffuse_apart) {
    c.diffuse *= c.diffuse_sum / c.diffuse_kept;
    c.diffuse_weight *= c.diffuse_sum / c.diffuse_kept;
  }
  c.glossy_weight = finite_or_black(c.glossy_weight / max(c.glossy_chance, 1e-30));
  c.diffuse = finite_or_black(c.diffuse);
  c.emission = finite_or_black(c.emission);
  c.transparency = finite_or_black(c.transparency);
  // A lobe's colour may stand in its Fresnel terms instead of its weight.
  c.glossy_tint = finite_or_black(c.glossy_tint);
  c.glossy_edge = finite_or_black(c.glossy_edge);
}
