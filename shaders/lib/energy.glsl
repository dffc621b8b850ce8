// Albedos of microfacet lobes from the table `energy_table`, and what follows from them: how much a layer leaves for
// the layer below, and how much light a lobe must gain because it scatters more than once.
//
// The host binds `energy_table` (sampler2D, 256 x 64 or 256 x 160 RGBA32F, filled by addon/materials/energy.py, where the layout and
// the sources are described) in every program that includes this file. `mu` is the cosine between the lobe's normal
// and the viewer, `roughness` the artist's roughness (alpha = roughness^2; for anisotropic lobes (ax ay)^(1/4), which
// is the same value).
//
// Multiple scattering after Turquin 2019, Fresnel averages and the F82 metal after Kulla & Conty 2017 and Kutz et al.
// 2021, in the form in which Cycles combines them.

#include "lib/closure.glsl"


#define ENERGY_NODES 32.0
#define LAYER_NODES 16.0
#define FINE_NODES 32.0

// Whether the tables are those of Cycles 5.3 and later: the dielectric layer has more nodes there, at sqrt(mu). Rough
// diffuse surfaces differ, too.
bool energy_is_fine()
{
  return energy_table_size().y > 64;
}

// Column and row of a fractional node position: xy the lower node, zw the weight of the next one.
vec4 energy_cell(float roughness, float mu, float nodes)
{
  vec2 position = clamp(vec2(roughness, mu), 0.0, 1.0) * (nodes - 1.0);
  vec2 lower = min(floor(position), vec2(nodes - 2.0));
  return vec4(lower, position - lower);
}

vec4 energy_bilinear(ivec2 origin, vec4 cell)
{
  ivec2 texel = origin + ivec2(cell.xy);
  vec4 low = mix(energy_table_fetch(texel), energy_table_fetch(texel + ivec2(1, 0)), cell.z);
  vec4 high = mix(
      energy_table_fetch(texel + ivec2(0, 1)), energy_table_fetch(texel + ivec2(1, 1)), cell.z);
  return mix(low, high, cell.w);
}

// Albedo of the single-scattering GGX lobe with reflectance 1.
float ggx_energy(float mu, float roughness)
{
  return energy_bilinear(ivec2(0, 0), energy_cell(roughness, mu, ENERGY_NODES)).z;
}

// Cosine-weighted mean of ggx_energy over the hemisphere.
float ggx_energy_average(float roughness)
{
  vec4 cell = energy_cell(roughness, 0.0, ENERGY_NODES);
  ivec2 texel = ivec2(int(cell.x), 32);
  return mix(energy_table_fetch(texel).z, energy_table_fetch(texel + ivec2(1, 0)).z, cell.z);
}

// Place of an index of refraction between the slices of a table: lower slice and weight of the next one.
vec2 ior_slice_of(float ior, float nodes)
{
  float z = clamp(sqrt(abs((ior - 1.0) / (ior + 1.0))), 0.0, 1.0) * (nodes - 1.0);
  float slice = min(floor(z), nodes - 2.0);
  return vec2(slice, z - slice);
}

vec2 ior_slice(float ior)
{
  return ior_slice_of(ior, LAYER_NODES);
}

// Where between reflectance at normal incidence (0) and total reflection (1) the mean of a dielectric lobe lies.
float dielectric_layer_shape(float mu, float roughness, float ior)
{
  if (energy_is_fine()) {
    vec2 fine = ior_slice_of(ior, FINE_NODES);
    int pair = int(fine.x) % 16;
    vec4 cell = energy_cell(roughness, sqrt(max(mu, 0.0)), FINE_NODES);
    vec4 four = energy_bilinear(ivec2(32 * (pair % 6), 64 + 32 * (pair / 6)), cell);
    return (fine.x < 16.0) ? mix(four.x, four.y, fine.y) : mix(four.z, four.w, fine.y);
  }
  vec2 slice = ior_slice(ior);
  int k = int(slice.x);
  vec4 ends = energy_bilinear(ivec2(16 * (k % 4), 16 * (k / 4)), energy_cell(roughness, mu, LAYER_NODES));
  return mix(ends.x, ends.y, slice.y);
}

// Albedos of a rough dielectric that scatters once: all, and what is reflected. From inside, ior is below 1.
vec2 glass_energy(float mu, float roughness, float ior)
{
  vec2 slice = ior_slice(ior);
  int k = int(slice.x);
  ivec2 origin = ivec2(((ior < 1.0) ? 128 : 64) + 16 * (k % 4), 16 * (k / 4));
  vec4 ends = energy_bilinear(origin, energy_cell(roughness, mu, LAYER_NODES));
  return mix(ends.xz, ends.yw, slice.y);
}

// Cosine-weighted mean of the first over the hemisphere.
float glass_energy_average(float roughness, float ior)
{
  vec2 slice = ior_slice(ior);
  vec4 cell = energy_cell(roughness, 0.0, LAYER_NODES);
  ivec2 texel = ivec2(((ior < 1.0) ? 48 : 32) + int(cell.x), 32 + int(slice.x));
  vec2 low = vec2(energy_table_fetch(texel).z, energy_table_fetch(texel + ivec2(1, 0)).z);
  vec2 high = vec2(energy_table_fetch(texel + ivec2(0, 1)).z,
                   energy_table_fetch(texel + ivec2(1, 1)).z);
  vec2 ends = mix(low, high, slice.y);
  return mix(ends.x, ends.y, cell.z);
}

// What a rough dielectric mirrors at once, its reflectance at normal incidence tinted to f0. Reflectance rises from f0 to
// 1 along one curve: solved for its mean where f0 is the real one.
vec3 glass_mirrored(vec3 f0, float mu, float roughness, float ior)
{
  float real_f0 = dielectric_f0(ior);
  float unit_energy = ggx_energy(mu, roughness);
  float rise = (glass_energy(mu, roughness, ior).y - real_f0 * unit_energy) / max(1.0 - real_f0, 1e-6);
  return clamp(vec3(rise) + f0 * (unit_energy - rise), vec3(0.0), vec3(1.0));
}

// And what it lets through at once.
vec3 glass_passing(vec3 f0, float mu, float roughness, float ior)
{
  return max(vec3(glass_energy(mu, roughness, ior).x) - glass_mirrored(f0, mu, roughness, ior), vec3(0.0));
}

// Factor on a rough dielectric that scatters once which restores what is scattered more than once, shared as the first
// time (Turquin 2019); each further time costs the colour of what passes, of which more than 1 would grow without end.
vec3 glass_multiscatter(vec3 transmitted, float mu, float roughness, float ior)
{
  transmitted = min(transmitted, vec3(1.0));
  float energy = max(glass_energy(mu, roughness, ior).x, 1e-4);
  float average = glass_energy_average(roughness, ior);
  vec3 again = transmitted * average / max(vec3(1.0) - transmitted * (1.0 - average), vec3(1e-6));
  return vec3(1.0) + again * max((1.0 - energy) / energy, 0.0);
}

// Albedo of a dielectric layer without tint.
float dielectric_layer_albedo(float mu, float roughness, float ior)
{
  return mix(dielectric_f0(ior), 1.0, dielectric_layer_shape(mu, roughness, ior));
}

// The same measure for a metal, whose reflectance rises with the fifth power.
float schlick_layer_shape(float mu, float roughness)
{
  return energy_bilinear(ivec2(32, 0), energy_cell(roughness, mu, LAYER_NODES)).z;
}

// Fresnel term of a lobe at cos_h = view . half vector; the kinds are explained in lib/closure.glsl.
vec3 fresnel_reflectance(int fresnel, vec3 tint, vec3 edge, float ior, float cos_h)
{
  if (fresnel == FRESNEL_DIELECTRIC) {
    float f0 = dielectric_f0(ior);
    float shape = clamp((fresnel_dielectric(cos_h, ior) - f0) / max(1.0 - f0, 1e-6), 0.0, 1.0);
    return mix(tint, vec3(1.0), shape);
  }
  if (fresnel == FRESNEL_F82) {
    float c = clamp(cos_h, 0.0, 1.0);
    float grazing = 1.0 - c;
    float power5 = grazing * grazing * grazing * grazing * grazing;
    // The last term pulls the curve to edge * Schlick at cos = 1/7, about 82 degrees: 0.46266436 = (6/7)^5,
    // 17.651384 = 7 / (6/7)^6.
    vec3 pull = mix(tint, vec3(1.0), 0.46266436) * (17.651384 * (vec3(1.0) - edge));
    return clamp(tint + (vec3(1.0) - tint) * power5 - pull * (c * power5 * grazing), vec3(0.0), vec3(1.0));
  }
  return tint;
}

// Cosine-weighted mean of fresnel_reflectance over the hemisphere.
vec3 fresnel_average(int fresnel, vec3 tint, vec3 edge, float ior)
{
  if (fresnel == FRESNEL_DIELECTRIC) {
    float f0 = dielectric_f0(ior);
    float shape = clamp((fresnel_average_dielectric(ior) - f0) / max(1.0 - f0, 1e-6), 0.0, 1.0);
    return mix(tint, vec3(1.0), shape);
  }
  if (fresnel == FRESNEL_F82) {
    // 1/21 and 1/126: means of (1-c)^5 and c (1-c)^6 under the cosine weight.
    vec3 pull = mix(tint, vec3(1.0), 0.46266436) * (17.651384 * (vec3(1.0) - edge));
    return mix(tint, vec3(1.0), 1.0 / 21.0) - pull / 126.0;
  }
  return tint;
}

// Reflectance of all bounces after the first, as a share of the light that a lobe without absorption would have lost.
vec3 multiscatter_reflectance(int fresnel, vec3 tint, vec3 edge, float ior, float roughness)
{
  float average = ggx_energy_average(roughness);
  vec3 once = fresnel_average(fresnel, tint, edge, ior);
  return once * average / max(vec3(1.0) - once * (1.0 - average), vec3(1e-6));
}

// Factor on the single-scattering lobe that restores what is scattered more than once; 1 for a smooth surface.
vec3 multiscatter_scale(int fresnel, vec3 tint, vec3 edge, float ior, float roughness, float mu)
{
  float energy = max(ggx_energy(mu, roughness), 1e-4);
  return vec3(1.0) + multiscatter_reflectance(fresnel, tint, edge, ior, roughness) * ((1.0 - energy) / energy);
}

// Share of the energy that survives when the lobe is scaled to lose none: multiscatter_scale * ggx_energy.
vec3 multiscatter_darkening(int fresnel, vec3 tint, vec3 edge, float ior, float roughness, float mu)
{
  float energy = clamp(ggx_energy(mu, roughness), 1e-4, 1.0);
  return vec3(energy) + multiscatter_reflectance(fresnel, tint, edge, ior, roughness) * (1.0 - energy);
}

// Estimated albedo of a glossy lobe with multiple scattering, as Cycles estimates it for its colour pass and for
// layering. FRESNEL_NONE carries its tint in Fresnel and in the loss per bounce, so it appears once here.
vec3 glossy_albedo(int fresnel, vec3 tint, vec3 edge, float ior, float roughness, float mu)
{
  vec3 darkening = multiscatter_darkening(fresnel, tint, edge, ior, roughness, mu);
  if (fresnel == FRESNEL_DIELECTRIC) {
    return darkening * mix(tint, vec3(1.0), dielectric_layer_shape(mu, roughness, ior));
  }
  if (fresnel == FRESNEL_F82) {
    return darkening * mix(tint, vec3(1.0), schlick_layer_shape(mu, roughness));
  }
  return darkening * tint;
}

// Sheen by microfibers (Zeltner, Burley & Chiang 2022): coefficients a, b of the linear map and the albedo, from the
// tables that tools/measure_sheen.py made.
vec3 sheen_terms(float mu, float roughness)
{
  vec4 cell = energy_cell(max(roughness, 1e-3), mu, ENERGY_NODES);
  return vec3(energy_bilinear(ivec2(0, 0), cell).w, energy_bilinear(ivec2(32, 0), cell).w,
              energy_bilinear(ivec2(0, 32), cell).w);
}
