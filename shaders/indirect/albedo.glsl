// What surfaces reflect, reduced to what paths need: how much of the light that meets them leaves them again, and a glossy
// lobe of few numbers. Where MATT is defined (addon/surfaces/reflectance.py) all surfaces are diffuse, and none lets light
// through.

#include "lib/hair.glsl"

// A diffuse part and one lobe of microfacets, whose reflectance runs from `straight` at normal incidence to `grazing`.
struct Reflection {
  vec3 diffuse;  // albedo, with what passes to the other side
  vec3 through;  // share of it that passes
  float rough;   // of the diffuse part; below 0 a strand of hair, which is so thick, m
  vec3 straight;
  vec3 grazing;
  float alpha;   // of the lobe; of a strand how much of what shines through goes on ahead (strand_ahead)
};

// Lobes of paths are at least as wide as this (roughness 0.5): a narrower one would make few points very bright, and who
// sees them is spread by more than that anyway (path regularisation after Kaplanyan & Dachsbacher 2013).
#define LEAST_ALPHA 0.25

// Factor by which the widened lobe of a smooth dielectric rises further towards grazing incidence, so that it reflects as
// much as the narrow one: of index 1.5 within a tenth up to 73 degrees (fitted to integrals over the hemisphere; at 78
// degrees .29 for .34, and the wide one alone .13).
#define RISE 2.7

// What a lobe without microfacets reflects of even light, over its weight: all of it but for velvet, whose fibres of spread
// s, integrated numerically over light and view, reflect s^2 / (1 + 1.17 s^2) to within 2 % (.01 at .1, .19 at .5, .46 at 1).
float soft_lobe_albedo(Surface s)
{
  float squared = s.glossy_roughness * s.glossy_roughness;
  return (s.kind == LOBE_VELVET) ? squared / (1.0 + 1.17 * squared) : 1.0;
}

// What a rough diffuse surface reflects of even light to all sides: less than its colour says, of dark ones a sixth.
vec3 rough_albedo(vec3 albedo, float weight, float roughness)
{
  float average = oren_nayar_average(roughness);
  vec3 rho = clamp(albedo / weight, vec3(0.0), vec3(1.0));
  return albedo * average * (vec3(1.0) + oren_nayar_tint(rho) * (1.0 - average) / (vec3(1.0) - rho * (1.0 - average)));
}

float lobe_albedo(Surface s, float roughness, float mu)
{
  return max_component(s.glossy_weight * glossy_albedo(s.kind, s.glossy_tint, s.glossy_edge, s.glossy_ior, roughness, mu));
}

// Of a thin coat that is kept beside the lobe below it.
float coat_albedo(Surface s, float mu)
{
  float albedo = 0.0;
  // A loop, since a rasteriser in software skips loops that no pixel enters, but no branches.
  for (bool coated = s.coated; coated; coated = false) {
    Surface coat = surface_coat(s);
    albedo = lobe_albedo(coat, coat.glossy_roughness, mu);
  }
  return albedo;
}

vec3 surface_albedo(Surface s, float mu)
{
  vec3 albedo = rough_albedo(s.diffuse, s.diffuse_weight, s.diffuse_roughness);
  if (s.kind > LOBE_REFRACTION) {
    albedo += s.glossy_weight * soft_lobe_albedo(s);
  }
  else if (s.kind != LOBE_REFRACTION && max_component(s.glossy_weight) > 0.0) {
    float roughness = lobe_roughness(lobe_alpha(s.glossy_roughness, s.glossy_anisotropy));
    albedo += s.glossy_weight *
              glossy_albedo(s.kind, s.glossy_tint, s.glossy_edge, s.glossy_ior, roughness, mu);
  }
  return max(albedo + coat_albedo(s, mu), vec3(0.0));
}

// Cosine between a normal and the mean direction from which diffuse light comes and to which it goes.
#define MEAN_COSINE 0.577

// Fresnel's terms as Schlick's curve, `mu` as above. A layer leaves the more to what is below it the steeper one looks:
// the camera's view of a floor is flat, that of what the floor lights is not.
Reflection surface_reflection(Surface s, float mu)
{
  Reflection r;
  r.diffuse = s.diffuse;
  r.rough = s.diffuse_roughness;
  r.through = vec3(0.0);
  r.straight = vec3(0.0);
  r.grazing = vec3(0.0);
  r.alpha = 1.0;
#ifndef MATT
  if (s.kind > LOBE_REFRACTION) {
    r.diffuse += s.glossy_weight * soft_lobe_albedo(s);
    if (s.kind == LOBE_TRANSLUCENT) {
      r.through = s.glossy_weight / max(r.diffuse, vec3(1e-30));
    }
    // A loop, since a rasteriser in software skips loops that no pixel enters, but no branches.
    for (bool fibre = is_fibre(s); fibre; fibre = false) {
      float thick = 2.0 * hair_radius(s.glossy_edge);
      r.through = hair_through(s.glossy_ior) * s.glossy_weight / max(r.diffuse, vec3(1e-30));
      r.rough = (thick > 2.0 * HAIR_FLAT) ? -thick : r.rough;
      r.alpha = 15.0 * max(0.9 - s.glossy_anisotropy, 0.0) * (1.3 - s.glossy_roughness);
    }
  }
  else if (s.kind != LOBE_REFRACTION && max_component(s.glossy_weight) > 0.0) {
    vec2 alpha = lobe_alpha(s.glossy_roughness, s.glossy_anisotropy);
    float narrow = min(sqrt(alpha.x * alpha.y) / LEAST_ALPHA, 1.0);
    r.alpha = max(sqrt(alpha.x * alpha.y), LEAST_ALPHA);
    float roughness = lobe_roughness(alpha);
    vec3 again = multiscatter_reflectance(FRESNEL_DIELECTRIC, s.glossy_tint, s.glossy_edge, s.glossy_ior, roughness);
    // A loop of a length that compilers do not know: they would compile what is in it twice.
    for (int k = (s.kind == FRESNEL_DIELECTRIC) ? 2 : 0; k > 0; k--) {
      float cosine = (k == 1) ? MEAN_COSINE : mu;
      float energy = clamp(ggx_energy(cosine, roughness), 1e-4, 1.0);
      float shape = dielectric_layer_shape(cosine, roughness, s.glossy_ior);
      vec3 albedo = (vec3(energy) + again * (1.0 - energy)) * mix(s.glossy_tint, vec3(1.0), shape);  // as glossy_albedo
      float left = 1.0 - min(max_component(s.glossy_weight * albedo), 0.9);
      r.diffuse *= (k == 1) ? left : 1.0 / left;
    }
    vec3 scale = s.glossy_weight * multiscatter_scale(s.kind, s.glossy_tint, s.glossy_edge, s.glossy_ior, sqrt(r.alpha), mu);
    r.straight = max(scale * s.glossy_tint, vec3(0.0));
    float rise = (s.kind == FRESNEL_NONE) ? 0.0 : (s.kind == FRESNEL_DIELECTRIC) ? mix(RISE, 1.0, narrow) : 1.0;
    r.grazing = mix(r.straight, max(scale, vec3(0.0)), rise);
  }
  for (bool coated = s.coated; coated; coated = false) {
    // One lobe of both, as wide as the two are in the mean. What lies below has the light that the coat leaves.
    Surface coat = surface_coat(s);
    float covers = coat_albedo(s, MEAN_COSINE);
    float leaves = (1.0 - min(covers, 0.9)) / (1.0 - min(coat_albedo(s, mu), 0.9));
    r.diffuse *= leaves;
    r.straight *= leaves;
    r.grazing *= leaves;
    float below = max_component(mix(r.straight, r.grazing, pow(1.0 - MEAN_COSINE, 5.0)));
    r.alpha = (below * r.alpha + covers * LEAST_ALPHA) / max(below + covers, 1e-6);
    vec3 scale = coat.glossy_weight
                 * multiscatter_scale(coat.kind, coat.glossy_tint, coat.glossy_edge, coat.glossy_ior, sqrt(LEAST_ALPHA), mu);
    float narrow = coat.glossy_roughness * coat.glossy_roughness / LEAST_ALPHA;
    r.straight += scale * coat.glossy_tint;
    r.grazing += mix(scale * coat.glossy_tint, scale, mix(RISE, 1.0, narrow));
  }
#endif
  r.diffuse = max(r.diffuse, vec3(0.0));
  return r;
}

// Of what shines through (leaves, paper) one of both sides is looked at, at random: as often the far one as its share of
// all diffuse light. `r` becomes what is received there, over the chance of that. `u`: random, 0 to 1.
bool reflects_far_side(inout Reflection r, float u)
{
  float chance = luminance(r.through * r.diffuse) / max(luminance(r.diffuse), 1e-30);
  bool far = u < chance;
  r.diffuse *= far ? r.through / max(chance, 1e-6) : (vec3(1.0) - r.through) / max(1.0 - chance, 1e-6);
  float shine = far ? 0.0 : 1.0 / max(1.0 - chance, 1e-6);
  r.straight *= shine;
  r.grazing *= shine;
  return far;
}

// Light that shines through a strand goes on about as it came: over what goes to all sides alike
//   (1 + .39 n) ((1 + c) / 2)^n,  c the cosine between its ways before and behind.
// Fitted to means of lib/hair.glsl over strands of all directions, met at all places of their width: n by both roughnesses
// within 1 for widths of .1 to .9, the factor such that as much leaves as without (within 1 %; the lobes' own light, index
// 1.55, is .95 of that of the diffuse part).
float strand_ahead(float n, float cosine)
{
  return (1.0 + 0.39 * n) * pow(max(0.5 + 0.5 * cosine, 1e-6), n);
}

// Radiance towards `viewer` per irradiance from `light`, 1/sr.
vec3 reflection_of(Reflection r, vec3 normal, vec3 light, vec3 viewer)
{
  vec3 sum = r.diffuse / PI;
  float nl = dot(normal, light);
  float nv = dot(normal, viewer);
  // A loop, as above.
  for (float rough = min(r.rough, min(nl, nv) * 1e5); rough > 1e-4; rough = 0.0) {
    sum = diffuse_reflection(r.diffuse, 1.0, r.rough, normal, viewer, light) / nl;
  }
#ifndef MATT
  for (bool passes = r.rough < 0.0 && nl > 0.0 && nv < 0.0; passes; passes = false) {
    sum *= strand_ahead(r.alpha, -dot(light, viewer));
  }
  if (max_component(r.grazing) > 0.0 && nl > 0.0 && nv > 0.0) {
    vec3 middle = safe_normalize(light + viewer);
    float squared = r.alpha * r.alpha;
    float d = dot(normal, middle);
    d = d * d * (squared - 1.0) + 1.0;
    float masked = nl * sqrt(nv * nv * (1.0 - squared) + squared) + nv * sqrt(nl * nl * (1.0 - squared) + squared);
    vec3 fresnel = mix(r.straight, r.grazing, pow(clamp(1.0 - dot(light, middle), 0.0, 1.0), 5.0));
    sum += fresnel * (squared / (PI * d * d) * 0.5 / masked);
  }
#endif
  return sum;
}

// A direction from which comes light that a surface reflects towards `viewer`: as often by its lobe (visible normals) as
// that sends of all that is reflected, else by the cosine. `weight`: what is reflected, times the cosine over the density of
// both ways together. By the cosine alone, a path between things that shine would be a thousand times too bright now and
// then, for each time that it leaves at a grazing angle.
vec3 reflection_sample(Reflection r, vec3 normal, vec3 viewer, vec2 u, out vec3 weight)
{
#ifdef MATT
  vec3 even = cosine_direction(normal, u);
  weight = (dot(normal, even) > 0.0) ? PI * reflection_of(r, normal, even, viewer) : vec3(0.0);
  return even;
#else
  float nv = dot(normal, viewer);
  vec3 reflected = mix(r.straight, r.grazing, pow(clamp(1.0 - nv, 0.0, 1.0), 5.0));
  float part = (nv > 0.0) ? luminance(reflected) / max(luminance(reflected + r.diffuse), 1e-30) : 0.0;
  bool shines = u.x < part;
  u.x = shines ? u.x / part : (u.x - part) / max(1.0 - part, 1e-6);
  // A strand that light shines through: as often by how it goes on ahead as that is narrow. By the cosine alone each of
  // many strands in a row would multiply by five what comes straight through all of them.
  float ahead = (r.rough < 0.0 && nv < 0.0) ? r.alpha / (1.0 + r.alpha) : 0.0;
  bool goes_ahead = u.x < ahead;
  u.x = goes_ahead ? u.x / ahead : (u.x - ahead) / max(1.0 - ahead, 1e-6);
  vec3 direction = cosine_direction(normal, u);
  vec2 alpha = vec2(r.alpha);
  float density = 1.0 - part;  // over that of the cosine
  for (float left = ahead; left > 0.0; left = 0.0) {
    vec3 side;
    vec3 up;
    orthonormal_basis(-viewer, side, up);
    float c = 2.0 * pow(u.x, 1.0 / (1.0 + r.alpha)) - 1.0;
    float away = sqrt(max(1.0 - c * c, 0.0));
    vec3 onward = away * (cos(2.0 * PI * u.y) * side + sin(2.0 * PI * u.y) * up) - c * viewer;
    direction = goes_ahead ? onward : direction;
    float lobe = 0.25 * (1.0 + r.alpha) * pow(max(0.5 - 0.5 * dot(direction, viewer), 1e-6), r.alpha);
    density = 1.0 - ahead + ahead * lobe / max(dot(normal, direction), 1e-6);
  }
  // A loop, as above.
  for (float left = part; left > 0.0; left = 0.0) {
    vec3 tangent;
    vec3 bitangent;
    orthonormal_basis(normal, tangent, bitangent);
    vec3 view = vec3(dot(tangent, viewer), dot(bitangent, viewer), nv);
    vec3 facet = visible_normal(view, alpha, u);
    facet = facet.x * tangent + facet.y * bitangent + facet.z * normal;
    direction = shines ? safe_normalize(2.0 * dot(viewer, facet) * facet - viewer) : direction;
    float d = dot(normal, safe_normalize(direction + viewer));
    float lobe = ggx_distribution(vec3(sqrt(max(1.0 - d * d, 0.0)), 0.0, d), alpha) / (4.0 * nv * (1.0 + ggx_lambda(view, alpha)));
    density += part * lobe * PI / max(dot(normal, direction), 1e-6);
  }
  weight = (dot(normal, direction) > 0.0) ? PI * reflection_of(r, normal, direction, viewer) / density : vec3(0.0);
  return direction;
#endif
}
