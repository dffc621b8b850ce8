// Reflection as Cycles has it: Lambert and energy-preserving Oren-Nayar, GGX with multiple-scattering compensation, and
// the distributions of before it.
// All return f * cos(normal, light); vectors are unit and point away from the surface.
#include "lib/math.glsl"
#include "lib/energy.glsl"
#include "lib/gbuffer.glsl"
#ifdef HAS_SURFACE_EDIT
#include "edit/rotation.glsl"
#endif

// Energy-preserving Oren-Nayar after Fujii, with the multiple-scattering term of the improved model. That term depends on
// the colour: the albedo without the weight of a mix and what a layer leaves.

// What light that is scattered among the facets keeps of its colour beside the first time: Cycles before 5.3 took the
// colour once too often.
vec3 oren_nayar_tint(vec3 rho)
{
  return energy_is_fine() ? rho : rho * rho;
}

float oren_nayar_albedo_term(float c)
{
  c = clamp(c, 0.0, 1.0);
  float s = sqrt(max(1.0 - c * c, 0.0));
  if (c < 1e-6) {
    return PI * 0.5 - 2.0 / 3.0 - c;
  }
  float theta = acos(c);
  return s * (theta - 2.0 / 3.0 - s * c) + (2.0 / 3.0) * (s / c) * (1.0 - s * s * s);
}

// Share of even light that is reflected once.
float oren_nayar_average(float roughness)
{
  float sigma = clamp(roughness, 0.0, 1.0);
  return (PI + sigma * (2.0 * PI - 5.6) / 3.0) / (PI + sigma * (PI * 0.5 - 2.0 / 3.0));
}

vec3 diffuse_reflection(vec3 albedo, float weight, float roughness, vec3 normal, vec3 view, vec3 light)
{
  float nl = max(dot(normal, light), 0.0);
  if (roughness < 1e-5) {
    return albedo * (nl / PI);
  }
  float nv = max(dot(normal, view), 0.0);
  float sigma = clamp(roughness, 0.0, 1.0);
  float a = 1.0 / (PI + sigma * (PI * 0.5 - 2.0 / 3.0));
  float b = sigma * a;
  float t = dot(light, view) - nl * nv;
  if (t > 0.0) {
    t /= max(max(nl, nv), 1e-6);
  }
  float view_term = PI * a + b * oren_nayar_albedo_term(nv);
  float light_term = PI * a + b * oren_nayar_albedo_term(nl);
  float average = oren_nayar_average(sigma);
  vec3 rho = clamp(albedo / weight, vec3(0.0), vec3(1.0));
  vec3 multiple = oren_nayar_tint(rho) * (average / (PI * max(1.0 - average, 1e-6))) / max(vec3(1.0) - rho * (1.0 - average), vec3(1e-6));
  return albedo * (nl * (a + b * t)) + albedo * multiple * (nl * (1.0 - view_term) * (1.0 - light_term));
}

// Share of the light along `light` that reaches a bumped surface over its own bumps: without, light that grazes the surface
// ends abruptly where the normal turns it away from the shading. Smith's shadowing of GGX, as rough as the normal deviates
// (Estevez, Lecocq & Stein, "A microfacet-based shadowing function to solve the bump terminator problem", 2019). As in
// Cycles it dims what is diffuse.
float bump_shadowing(Surface s, vec3 light)
{
  if (s.bump <= 0.0) {
    return 1.0;
  }
  float cosine = clamp(dot(s.base_normal, light), 1e-6, 1.0);  // none arrives from below
  return bump_dimming(s.bump * s.bump, cosine);
}

// f * cos of the diffuse closure.
vec3 surface_diffuse_reflection(Surface s, vec3 view, vec3 light)
{
  return diffuse_reflection(s.diffuse, s.diffuse_weight, s.diffuse_roughness, s.normal, view, light) * bump_shadowing(s, light);
}

// A lobe of microfacets in its own frame: z along the normal, x along the tangent. Energy compensation is in `scale`.
struct Lobe {
  vec3 tangent;
  vec3 bitangent;
  vec3 normal;
  vec2 alpha;
  vec3 scale;  // weight x multiple scattering
  int kind;
  vec3 tint;
  vec3 edge;
  float ior;
  int distribution;
  vec3 view;   // in the lobe's frame
};

// Below this product of alphas a lobe is a mirror: only traced rays can see anything in it.
#define MIRROR_ALPHA 2e-10

vec3 lobe_to_local(Lobe lobe, vec3 v)
{
  return vec3(dot(v, lobe.tangent), dot(v, lobe.bitangent), dot(v, lobe.normal));
}

vec3 lobe_to_world(Lobe lobe, vec3 v)
{
  return v.x * lobe.tangent + v.y * lobe.bitangent + v.z * lobe.normal;
}

// The microfacet lobe of a surface, seen from `view`.
Lobe lobe_begin(Surface s, vec3 view)
{
  Lobe lobe;
  vec3 t;
  vec3 b;
  orthonormal_basis(s.glossy_normal, t, b);
  float angle = PI * s.tangent_angle;
  lobe.tangent = cos(angle) * t + sin(angle) * b;
  lobe.bitangent = cross(s.glossy_normal, lobe.tangent);
  lobe.normal = s.glossy_normal;
  lobe.alpha = lobe_alpha(s.glossy_roughness, s.glossy_anisotropy);
  lobe.kind = s.kind;
  lobe.tint = s.glossy_tint;
  lobe.edge = s.glossy_edge;
  lobe.ior = s.glossy_ior;
  lobe.distribution = s.distribution;
  lobe.view = lobe_to_local(lobe, view);
  float roughness = lobe_roughness(lobe.alpha);
  lobe.scale = s.glossy_weight * multiscatter_scale(s.kind, lobe.tint, lobe.edge, lobe.ior, roughness, lobe.view.z);
#ifdef HAS_SURFACE_EDIT
  // The view has its place in the lobe; where light comes from turns with the edit.
  if (surface_is_edited(s)) {
    lobe.tangent = quaternion_turned(s.edit, lobe.tangent);
    lobe.bitangent = quaternion_turned(s.edit, lobe.bitangent);
    lobe.normal = quaternion_turned(s.edit, lobe.normal);
  }
#endif
  return lobe;
}

float ggx_lambda(vec3 w, vec2 alpha)
{
  float tan_squared = dot(w.xy * alpha, w.xy * alpha) / max(w.z * w.z, 1e-20);
  return 0.5 * (sqrt(1.0 + tan_squared) - 1.0);
}

float ggx_distribution(vec3 h, vec2 alpha)
{
  vec2 slope = h.xy / alpha;
  float d = dot(slope, slope) + h.z * h.z;
  return 1.0 / max(PI * alpha.x * alpha.y * d * d, 1e-30);
}

bool lobe_is_mirror(Lobe lobe)
{
  return lobe.alpha.x * lobe.alpha.y <= MIRROR_ALPHA;
}

// What a facet of the distributions other than GGX reflects, f * cos without Fresnel and scale. Walter et al.,
// "Microfacet models for refraction", 2007: Beckmann's with Smith's shadowing, its rational fit; Ashikhmin & Shirley, "An
// anisotropic Phong BRDF model", 2000, whose exponents are 2 / alpha^2 - 2.
float beckmann_lambda(vec3 w, vec2 alpha)
{
  float a = abs(w.z) / max(length(w.xy * alpha), 1e-20);
  return (a < 1.6) ? (1.0 - 1.259 * a + 0.396 * a * a) / (3.535 * a + 2.181 * a * a) : 0.0;
}

float other_facet(Lobe lobe, vec3 h, vec3 light)
{
  vec2 alpha = max(lobe.alpha, vec2(1e-4));
  float up = clamp(h.z, 1e-6, 1.0);
  if (lobe.distribution == DISTRIBUTION_BECKMANN) {
    vec2 slope = h.xy / (alpha * up);
    float distribution = exp(-dot(slope, slope)) / (PI * alpha.x * alpha.y * up * up * up * up);
    float shadowing = 1.0 + beckmann_lambda(lobe.view, alpha) + beckmann_lambda(light, alpha);
    return distribution / (4.0 * lobe.view.z * shadowing);
  }
  vec2 exponents = max(2.0 / (alpha * alpha) - 2.0, vec2(0.0));
  float aside = dot(h.xy, h.xy);
  float exponent = (aside > 1e-10) ? dot(exponents, h.xy * h.xy) / aside : exponents.x;
  float norm = sqrt((exponents.x + 1.0) * (exponents.y + 1.0)) / (8.0 * PI);
  return light.z * norm * pow(up, exponent) / max(max(dot(h, light), 1e-6) * max(light.z, lobe.view.z), 1e-6);
}

// f * cos for a light direction in world space; `pdf` is the density per steradian of lobe_sample for it.
vec3 lobe_reflection(Lobe lobe, vec3 light_world, out float pdf)
{
  vec3 light = lobe_to_local(lobe, light_world);
  vec3 view = lobe.view;
  pdf = 0.0;
  if (light.z <= 0.0 || view.z <= 0.0 || lobe_is_mirror(lobe)) {
    return vec3(0.0);
  }
  vec3 h = safe_normalize(light + view);
  float distribution = ggx_distribution(h, lobe.alpha);
  float lambda_view = ggx_lambda(view, lobe.alpha);
  float lambda_light = ggx_lambda(light, lobe.alpha);
  float facet = distribution / (4.0 * view.z);
  pdf = facet / (1.0 + lambda_view);
  vec3 fresnel = fresnel_reflectance(lobe.kind, lobe.tint, lobe.edge, lobe.ior, dot(h, view));
  float reflected = facet / (1.0 + lambda_view + lambda_light);
  // A loop, since a rasteriser in software skips loops that no pixel enters, but no branches.
  for (int k = DISTRIBUTION_MULTI_GGX; k < lobe.distribution; k = lobe.distribution) {
    reflected = other_facet(lobe, h, light);
  }
  return lobe.scale * fresnel * reflected;
}

// A microfacet's normal among those that `view` sees, all in the frame of the surface (Dupuy & Benyoub 2023, spherical
// caps).
vec3 visible_normal(vec3 view, vec2 alpha, vec2 u)
{
  vec3 stretched = safe_normalize(vec3(alpha * view.xy, view.z));
  float phi = 2.0 * PI * u.x;
  float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
  float r = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
  vec3 cap = vec3(r * cos(phi), r * sin(phi), z) + stretched;
  return safe_normalize(vec3(alpha * cap.xy, max(cap.z, 1e-7)));
}

// A direction in world space drawn from the lobe by visible normals, and `weight` = f * cos / pdf for it. Zero weight
// where it would go below the surface.
vec3 lobe_sample(Lobe lobe, vec2 u, out vec3 weight)
{
  vec3 view = lobe.view;
  vec3 h = vec3(0.0, 0.0, 1.0);
  bool mirror = lobe_is_mirror(lobe);
  if (!mirror) {
    h = visible_normal(view, lobe.alpha, u);
  }
  vec3 light = 2.0 * dot(view, h) * h - view;
  weight = vec3(0.0);
  if (light.z > 0.0 && view.z > 0.0) {
    float masking = 1.0;
    if (!mirror) {
      float lambda_view = ggx_lambda(view, lobe.alpha);
      masking = (1.0 + lambda_view) / (1.0 + lambda_view + ggx_lambda(light, lobe.alpha));
    }
    for (int k = DISTRIBUTION_MULTI_GGX; k < lobe.distribution && !mirror; k = lobe.distribution) {
      float density = ggx_distribution(h, lobe.alpha) / (4.0 * view.z * (1.0 + ggx_lambda(view, lobe.alpha)));
      masking = other_facet(lobe, h, light) / max(density, 1e-30);
    }
    weight = lobe.scale * masking * fresnel_reflectance(lobe.kind, lobe.tint, lobe.edge, lobe.ior, dot(h, view));
  }
  return safe_normalize(lobe_to_world(lobe, light));
}
