// One function per shader node: it turns the node's inputs into closures, scaled by `weight`, the share of the
// surface that the node owns. Order of layers, clamps and weights as in Cycles (see materials/nodes/shader.py).

#include "lib/closure.glsl"
#include "lib/color.glsl"
#include "lib/energy.glsl"

#include "material/thin_film.glsl"

#ifdef SUBSURFACE
#include "subsurface/closure.glsl"
#endif

#define MOST_IOR 1e5  // of an index of refraction: it mirrors all but a hundred-thousandth, and more would leave float32

// A layer with less weight than this is not worth a lobe.
#define SMALLEST_WEIGHT 1e-5

vec3 unit_or(vec3 v, vec3 otherwise)
{
  float length_squared = dot(v, v);
  return (length_squared > 1e-20) ? v * inversesqrt(length_squared) : otherwise;
}

// Bends a shading normal towards the geometric normal, just so far that the mirror direction leaves the surface:
// a mirror direction below the surface would see its inside and show black at grazing angles.
// In the plane of both normals with angle a from the geometric one, reflected . geometric =
// x sin 2a + z cos 2a, where (x, z) is the incoming direction in that plane; solved for the smallest allowed value.
vec3 reflecting_normal(SurfacePoint point, vec3 normal)
{
  vec3 up = point.geometric_normal;
  float z = dot(point.incoming, up);
  float smallest = min(0.9 * z, 0.01);
  vec3 reflected = 2.0 * dot(normal, point.incoming) * normal - point.incoming;
  if (z <= 0.0 || dot(reflected, up) >= smallest) {
    return normal;
  }
  vec3 side = unit_or(normal - dot(normal, up) * up, vec3(0.0));
  float x = dot(point.incoming, side);
  float reach = sqrt(x * x + z * z);
  float angle = 0.5 * (atan(x, z) + acos(clamp(smallest / max(reach, 1e-20), -1.0, 1.0)));
  return unit_or(sin(angle) * side + cos(angle) * up, normal);
}

float view_cosine(SurfacePoint point, vec3 normal)
{
  return clamp(dot(normal, point.incoming), 0.0, 1.0);
}

// Any direction that changes smoothly, for lobes without one and where none can be told.
vec3 default_tangent(vec3 normal)
{
  return unit_or(vec3(-normal.y, normal.x, 0.0), vec3(1.0, 0.0, 0.0));
}

// The tangent turned about the normal; `turns` counts full turns.
vec3 rotated_tangent(vec3 tangent, vec3 normal, float turns)
{
  vec3 flat_tangent = unit_or(tangent - dot(tangent, normal) * normal, default_tangent(normal));
  float angle = 6.283185307 * fract(turns);  // also of turns so many that no angle is left in a float
  return cos(angle) * flat_tangent + sin(angle) * cross(normal, flat_tangent);
}

float largest(vec3 v)
{
  return max(max(v.x, v.y), v.z);
}

// How bright a lobe of this albedo is to the path that came here.
float useful_luminance(Closures closures, vec3 albedo)
{
#ifdef PATH_COLOR
  return color_luminance(closures.path * albedo) / max(color_luminance(closures.path), 1e-6);
#else
  return color_luminance(albedo);
#endif
}

// Adds a glossy lobe and returns its albedo, weight included: what the layers below do not get.
vec3 add_glossy(inout Closures closures, SurfacePoint point, vec3 weight, int distribution, int fresnel, vec3 tint,
                vec3 edge, float ior, float roughness, float anisotropy, vec3 tangent, vec3 normal)
{
  float mu = view_cosine(point, normal);
  float wide = lobe_roughness(lobe_alpha(roughness, anisotropy));  // less than `roughness` where alpha is cut off at 1
  vec3 albedo = glossy_albedo(fresnel, tint, edge, ior, wide, mu);
  vec3 lobe_weight = weight;
  if (distribution != DISTRIBUTION_MULTI_GGX) {
    // The lobe is evaluated with multiple scattering, which the node excludes: taken out again by its weight.
    albedo /= max(multiscatter_darkening(fresnel, tint, edge, ior, wide, mu), vec3(1e-4));
    lobe_weight /= multiscatter_scale(fresnel, tint, edge, ior, wide, mu);
  }
  if (closure_glossy(closures, lobe_weight, useful_luminance(closures, albedo), fresnel, tint, edge, ior, roughness,
                     anisotropy, tangent, normal)) {
    closures.distribution = distribution;
  }
  return weight * albedo;
}

// Adds a lobe of microfacets under a thin film, and returns its albedo, weight included: reflectance as seen from here, for
// light from everywhere. What bounces between facets is as without the film.
vec3 add_film(inout Closures closures, SurfacePoint point, vec3 weight, int distribution, Film film, int fresnel, vec3 tint,
              vec3 edge, float ior, float roughness, float anisotropy, vec3 tangent, vec3 normal)
{
  float mu = view_cosine(point, normal);
  float wide = lobe_roughness(lobe_alpha(roughness, anisotropy));
  vec3 seen = film_seen(film, mu, wide);
  vec3 albedo = film_reflectance(film, mu);
  vec3 lobe_weight = weight / multiscatter_scale(FRESNEL_NONE, seen, vec3(1.0), 1.5, wide, mu);
  if (distribution == DISTRIBUTION_MULTI_GGX) {
    albedo *= multiscatter_darkening(fresnel, tint, edge, ior, wide, mu);
    lobe_weight *= multiscatter_scale(fresnel, tint, edge, ior, wide, mu);
  }
  if (closure_glossy(closures, lobe_weight, color_luminance(albedo), FRESNEL_NONE, seen, vec3(1.0), 1.5, roughness,
                     anisotropy, tangent, normal)) {
    closures.distribution = distribution;
  }
  return weight * albedo;
}

// What a layer of this albedo leaves of `weight`: one factor for all channels, so that a tinted layer does not
// colour what lies below.
vec3 below_layer(vec3 weight, vec3 albedo)
{
  vec3 share = albedo / max(weight, vec3(1e-10));
  return weight * clamp(1.0 - largest(share), 0.0, 1.0);
}

// Adds a lobe without microfacets; its colour is its albedo.
void add_soft(inout Closures closures, int kind, vec3 weight, float roughness, float smoothness, vec3 edge,
              vec3 normal)
{
  closure_glossy(closures, weight, 1.0, kind, vec3(1.0), edge, 1.5, roughness, smoothness, vec3(0.0), normal);
}

// Adds a layer of microfiber sheen and returns its albedo, weight included.
vec3 add_sheen(inout Closures closures, SurfacePoint point, vec3 weight, float roughness, vec3 normal)
{
  vec3 albedo = weight * sheen_terms(dot(normal, point.incoming), roughness).z;
  add_soft(closures, LOBE_SHEEN, albedo, roughness, 0.0, vec3(1.0), normal);
  return albedo;
}

// Hair. Of light that meets a fibre about HAIR_MIRRORED is reflected at its surface; the rest crosses the inside, on average
// 1.57 radii long, and leaves it for the most part. What it absorbs follows from a colour, by the fit of Chiang et al. 2016
// for the colour of many strands together, or from pigments.
#define HAIR_MIRRORED 0.08
#define HAIR_PATH 1.57

vec3 hair_absorption(vec3 color, float roughness)
{
  float b = roughness;
  float fit = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
  vec3 root = log(clamp(color, vec3(1e-5), vec3(1.0))) / fit;
  return root * root;
}

void shader_hair(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, int kind, float melanin,
                 float redness, vec3 tint, vec3 coefficient, float roughness, vec3 normal)
{
  vec3 absorption = max(coefficient, vec3(0.0));
  if (kind == 0) {
    absorption = hair_absorption(color, roughness);
  }
  else if (kind == 1) {
    float amount = -log(max(1.0 - clamp(melanin, 0.0, 1.0), 1e-4));
    float red = clamp(redness, 0.0, 1.0);
    absorption = amount * mix(vec3(0.506, 0.841, 1.653), vec3(0.343, 0.733, 1.924), red)
                 + hair_absorption(tint, roughness);
  }
  vec3 passing = exp(-HAIR_PATH * absorption);
  vec3 albedo = weight * (HAIR_MIRRORED + (1.0 - HAIR_MIRRORED) * passing);
  vec3 n = unit_or(normal, point.normal);
  closure_diffuse(closures, 0.5 * albedo, vec3(1.0), 0.0, n);
  add_soft(closures, LOBE_TRANSLUCENT, 0.5 * albedo, 1.0, 0.0, vec3(1.0), n);
}

void shader_diffuse(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float roughness, vec3 normal)
{
  closure_diffuse(closures, weight, max(color, vec3(0.0)), clamp(roughness, 0.0, 1.0), unit_or(normal, point.normal));
}

// Diffuse where it is lit; the pass of light below surfaces spreads it (subsurface/closure.glsl). `radius` in metres.
void add_subsurface(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, vec3 radius, float ior,
                    float roughness, float anisotropy, vec3 normal, int method)
{
#ifdef SUBSURFACE
  closure_subsurface(closures, weight, color, radius, ior, roughness, anisotropy, view_cosine(point, normal),
                     method);
#endif
}

// Maps that an artist paints (materials/translucency.py): of the pass of light below surfaces alone.
void shader_translucency_maps(inout Closures closures, SurfacePoint point, vec3 weight, float blur, vec3 tint,
                              float translucency)
{
#ifdef SUBSURFACE
  closures.map_length = exp2(6.0 * (clamp(blur, 0.0, 1.0) - 0.5));
  closures.map_entry = vec4(max(tint, vec3(0.0)), clamp(translucency, 0.0, 1.0));
#endif
}

void shader_subsurface(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float scale, vec3 radius,
                       float ior, float roughness, float anisotropy, vec3 normal, int method)
{
  vec3 n = unit_or(normal, point.normal);
  vec3 base = max(color, vec3(0.0));
  add_subsurface(closures, point, weight, base, radius * scale, ior, roughness, anisotropy, n, method);
  closure_diffuse(closures, weight, base, 0.0, n);
}

void shader_sheen(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float roughness, vec3 normal)
{
  add_sheen(closures, point, weight * max(color, vec3(0.0)), clamp(roughness, 0.0, 1.0), unit_or(normal, point.normal));
}

void shader_velvet(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float spread, vec3 normal)
{
  add_soft(closures, LOBE_VELVET, weight * max(color, vec3(0.0)), clamp(spread, 0.0, 1.0), 0.0, vec3(1.0),
           unit_or(normal, point.normal));
}

void shader_translucent(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, vec3 normal)
{
  add_soft(closures, LOBE_TRANSLUCENT, weight * max(color, vec3(0.0)), 1.0, 0.0, vec3(1.0),
           reflecting_normal(point, unit_or(normal, point.normal)));
}

void shader_toon(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float size, float smoothness,
                 vec3 normal, float glossy)
{
  add_soft(closures, LOBE_TOON, weight * max(color, vec3(0.0)), clamp(size, 0.0, 1.0), clamp(smoothness, 0.0, 1.0),
           vec3(glossy), unit_or(normal, point.normal));
}

// Glossy node: reflectance is the colour at all angles. Its anisotropy stretches the other way round than that of
// Principled: ax = a (1 - A), ay = a / (1 - A).
void shader_glossy(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float roughness,
                   float anisotropy, float rotation, vec3 normal, vec3 tangent, int distribution)
{
  vec3 n = reflecting_normal(point, unit_or(normal, point.normal));
  float amount = clamp(anisotropy, -0.99, 0.99);
  float quarter = (amount > 0.0) ? 0.25 : 0.0;
  vec3 t = rotated_tangent(tangent, n, rotation + quarter);
  add_glossy(closures, point, weight, distribution, FRESNEL_NONE, max(color, vec3(0.0)), vec3(1.0), 1.5,
             clamp(roughness, 0.0, 1.0), abs(amount), t, n);
}

// Of Principled and metals: ax = a / sqrt(1 - 0.9 A), ay = a sqrt(1 - 0.9 A).
float lobe_anisotropy(float anisotropy)
{
  return 1.0 - sqrt(1.0 - 0.9 * clamp(anisotropy, 0.0, 1.0));
}

void shader_metallic(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, vec3 edge, float roughness,
                     float anisotropy, float rotation, vec3 normal, vec3 tangent, int distribution, float film_thickness,
                     float film_ior)
{
  vec3 n = reflecting_normal(point, unit_or(normal, point.normal));
  vec3 t = rotated_tangent(tangent, n, rotation);
  if (film_thickness > FILM_LEAST) {
    vec3 f0 = clamp(color, vec3(0.0), vec3(1.0));
    vec3 tint = clamp(edge, vec3(0.0), vec3(1.0));
    add_film(closures, point, weight, distribution, film_on_metal(film_thickness, film_ior, f0, tint), FRESNEL_F82, f0, tint,
             1.5, clamp(roughness, 0.0, 1.0), lobe_anisotropy(anisotropy), t, n);
    return;
  }
  add_glossy(closures, point, weight, distribution, FRESNEL_F82, clamp(color, vec3(0.0), vec3(1.0)),
             clamp(edge, vec3(0.0), vec3(1.0)), 1.5, clamp(roughness, 0.0, 1.0), lobe_anisotropy(anisotropy), t, n);
}

float conductor_reflectance(float cos_i, float n, float k)
{
  float c = cos_i * cos_i;
  float nk = n * n + k * k;
  float s = (nk - 2.0 * n * cos_i + c) / (nk + 2.0 * n * cos_i + c);
  float p = (nk * c - 2.0 * n * cos_i + 1.0) / (nk * c + 2.0 * n * cos_i + 1.0);
  return 0.5 * (s + p);
}

// Metal by complex index of refraction: the F82 curve through its exact reflectance at 0 and at 82 degrees.
void shader_conductor(inout Closures closures, SurfacePoint point, vec3 weight, vec3 ior, vec3 extinction,
                      float roughness, float anisotropy, float rotation, vec3 normal, vec3 tangent, int distribution,
                      float film_thickness, float film_ior)
{
  vec3 f0 = vec3(conductor_reflectance(1.0, ior.x, extinction.x), conductor_reflectance(1.0, ior.y, extinction.y),
                 conductor_reflectance(1.0, ior.z, extinction.z));
  float c = 1.0 / 7.0;
  vec3 f82 = vec3(conductor_reflectance(c, ior.x, extinction.x), conductor_reflectance(c, ior.y, extinction.y),
                  conductor_reflectance(c, ior.z, extinction.z));
  vec3 edge = f82 / max(mix(f0, vec3(1.0), 0.46266436), vec3(1e-6));
  if (film_thickness > FILM_LEAST) {
    vec3 upright = reflecting_normal(point, unit_or(normal, point.normal));
    Film film = film_over(film_thickness, film_ior, true, max(ior, vec3(0.0)), max(extinction, vec3(0.0)));
    add_film(closures, point, weight, distribution, film, FRESNEL_F82, f0, edge, 1.5, clamp(roughness, 0.0, 1.0),
             lobe_anisotropy(anisotropy), rotated_tangent(tangent, upright, rotation), upright);
    return;
  }
  shader_metallic(closures, point, weight, f0, edge, roughness, anisotropy, rotation, normal, tangent, distribution, 0.0,
                  1.0);
}

void shader_emission(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float strength)
{
  closure_emission(closures, weight * color * strength);
}

void shader_transparent(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color)
{
  closure_transparent(closures, weight * max(color, vec3(0.0)));
}

// A volume has no surface: plugged in as one, it is black.
void shader_inside(inout Closures closures, SurfacePoint point, vec3 weight)
{
}

void shader_holdout(inout Closures closures, SurfacePoint point, vec3 weight)
{
  closures.holdout += vector_average(weight);
}

// Whether smooth glass is kept as one lobe that mirrors, too: of what the camera sees, where rays follow both.
#ifndef BOTH_WAYS
#define BOTH_WAYS false
#endif
// Whether a thin coat is kept beside the lobe below it: of what the camera sees, where rays follow both.
#ifndef COAT_APART
#define COAT_APART false
#endif
// How often glass at least mirrors that is asked for one way.
#ifndef LEAST_MIRRORED
#define LEAST_MIRRORED 0.25
#endif

// Glass: a rough dielectric that mirrors and lets through. What passes is a lobe of its own where the program draws what
// is bent, and else goes straight on, tinted, with the same energy. `tint` colours the reflectance at normal incidence.
void add_glass(inout Closures closures, SurfacePoint point, vec3 weight, vec3 reflected, vec3 transmitted,
                       vec3 tint, float ior, float roughness, vec3 normal, int distribution, float film_thickness,
                       float film_ior)
{
  vec3 n = reflecting_normal(point, unit_or(normal, point.normal));
  float r = clamp(roughness, 0.0, 1.0);
  float mu = view_cosine(point, n);
  ior = (point.refracts && point.backfacing) ? 1.0 / ior : ior;
  vec3 f0 = clamp(dielectric_f0(ior) * tint, vec3(0.0), vec3(1.0));
  vec3 mirrored = glass_mirrored(f0, mu, r, ior);
  vec3 through = glass_passing(f0, mu, r, ior);
  vec3 scale = weight;
  if (distribution == DISTRIBUTION_MULTI_GGX) {
    scale *= glass_multiscatter(transmitted, mu, r, ior);
  }
  if (film_thickness > FILM_LEAST) {
    // From inside the film lies on the far face: the same with all indices relative to the glass.
    float relative = (point.refracts && point.backfacing) ? film_ior * ior : film_ior;
    vec3 face = film_seen(film_on_dielectric(film_thickness, relative, ior, f0), mu, r);
    if (largest(reflected) > 0.0) {
      vec3 lobe_scale = multiscatter_scale(FRESNEL_NONE, face, vec3(1.0), 1.5, r, mu);
      float importance = max(color_luminance(face), point.refracts ? LEAST_MIRRORED : 0.0);
      closure_glossy(closures, scale * reflected / lobe_scale, importance, FRESNEL_NONE, face, vec3(1.0), 1.5, r, 0.0,
                     default_tangent(n), n);
    }
    vec3 passing = scale * max(transmitted, vec3(0.0)) * (1.0 - face);
    if (point.refracts) {
      closure_glossy(closures, passing, 1.0, LOBE_REFRACTION, vec3(0.0), vec3(0.0), ior, r, 0.0, default_tangent(n), n);
    }
    else {
      closure_transparent(closures, passing);
    }
    return;
  }
  if (BOTH_WAYS && point.refracts && r <= BOTH_ROUGHNESS && largest(reflected) > 0.0) {
    // As one lobe, so that no sample lacks either of the two.
    vec3 mirror = scale * reflected / multiscatter_scale(FRESNEL_DIELECTRIC, f0, vec3(1.0), ior, r, mu);
    vec3 passing = scale * max(transmitted, vec3(0.0));
    float most = largest(mirror);
    float share_of_most = most / max(largest(passing), 1e-6);
    // A channel that glass neither mirrors nor lets pass has any share.
    vec3 share = mix(mirror / max(passing, vec3(1e-6)), vec3(share_of_most), lessThanEqual(max(mirror, passing), vec3(0.0)));
    bool colored = largest(abs(share - vec3(share.x))) < 2e-3 * share.x;
    bool grey = largest(abs(mirror - vec3(most))) < 2e-3 * most;
    float ratio = colored ? share.x : share_of_most;
    if ((colored || grey) && ratio < BOTH_MOST) {
      closure_glossy(closures, passing, 1.0, LOBE_REFRACTION, f0, both_ways_edge(ratio, colored), ior, r, 0.0,
                     default_tangent(n), n);
      return;
    }
  }
  if (largest(reflected) > 0.0) {
    vec3 lobe_scale = multiscatter_scale(FRESNEL_DIELECTRIC, f0, vec3(1.0), ior, r, mu);
    // What little glass mirrors is often the brightest in view: kept more often than its albedo asks for.
    float importance = max(color_luminance(mirrored), point.refracts ? LEAST_MIRRORED : 0.0);
    closure_glossy(closures, scale * reflected / lobe_scale, importance, FRESNEL_DIELECTRIC, f0, GLASS_EDGE, ior, r, 0.0,
                   default_tangent(n), n);
  }
  vec3 color = scale * max(transmitted, vec3(0.0));
  if (point.refracts) {
    closure_glossy(closures, color, color_luminance(through), LOBE_REFRACTION, f0, vec3(1.0), ior, r, 0.0,
                   default_tangent(n), n);
  }
  else {
    closure_transparent(closures, color * through);
  }
}

// Indices of refraction for red, green and blue (611, 549 and 464 nm, as of sRGB's primaries) of glass with the index `ior`
// at 587.6 nm and an Abbe number: Cauchy's n = A + B / wavelength^2, which has (ior - 1) / abbe between 486.1 and 656.3 nm.
vec3 dispersed_index(float ior, float abbe)
{
  return vec3(ior) + (ior - 1.0) / abbe * vec3(-0.1139, 0.2207, 0.9154);
}

// A wall that is thin against its surroundings: what enters leaves again in the same direction. Of a ray that is reflected
// with R at each face and absorbed to a on each way through, the wall reflects R + (1 - R)^2 R a^2 / (1 - R^2 a^2) and
// lets (1 - R)^2 a / (1 - R^2 a^2) pass; the way through grows with the refracted angle.
void shader_thin_wall(inout Closures closures, SurfacePoint point, vec3 weight, vec3 base, vec3 tint, float ior,
                      float roughness, vec3 normal, float film_thickness, float film_ior)
{
  float mu = view_cosine(point, normal);
  vec3 f0 = clamp(dielectric_f0(ior) * tint, vec3(0.0), vec3(1.0));
  float cos_inside = sqrt(max(1.0 - (1.0 - mu * mu) / (ior * ior), 1e-4));
  vec3 absorbed = pow(clamp(base, vec3(0.0), vec3(1.0)), vec3(1.0 / cos_inside));
  // As in Cycles, roughness spreads the light and leaves its amount.
  vec3 face = clamp(fresnel_reflectance(FRESNEL_DIELECTRIC, f0, vec3(1.0), ior, mu), vec3(1e-6), vec3(1.0));
  bool filmed = film_thickness > FILM_LEAST;
  if (filmed) {
    face = clamp(film_seen(film_on_dielectric(film_thickness, film_ior, ior, f0), mu, roughness), vec3(1e-6), vec3(1.0));
  }
  vec3 entering = (1.0 - face) * (1.0 - face) / max(1.0 - face * face * absorbed * absorbed, vec3(1e-6));
  vec3 mirrored = face + entering * face * absorbed * absorbed;
  int kind = filmed ? FRESNEL_NONE : FRESNEL_DIELECTRIC;
  vec3 shown = filmed ? face : f0;
  vec3 lobe = glossy_albedo(kind, shown, vec3(1.0), ior, roughness, mu);
  closure_glossy(closures, weight * mirrored / max(lobe, vec3(1e-6)), color_luminance(mirrored), kind, shown, vec3(1.0),
                 ior, roughness, 0.0, default_tangent(normal), normal);
  closure_transparent(closures, weight * entering * absorbed);
}

void shader_glass(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float roughness, float ior,
                  vec3 normal, int distribution, float film_thickness, float film_ior)
{
  vec3 positive = max(color, vec3(0.0));
  add_glass(closures, point, weight, positive, positive, vec3(1.0), clamp(ior, 1e-5, MOST_IOR), roughness, normal,
            distribution, film_thickness, max(film_ior, 1e-5));
}

// What passes an interface without the losses of reflection.
void shader_refraction(inout Closures closures, SurfacePoint point, vec3 weight, vec3 color, float roughness, float ior,
                       vec3 normal)
{
  vec3 passing = weight * max(color, vec3(0.0));
  if (point.refracts) {
    float inside = clamp(ior, 1e-5, MOST_IOR);
    vec3 n = reflecting_normal(point, unit_or(normal, point.normal));
    closure_glossy(closures, passing, 1.0, LOBE_REFRACTION, vec3(0.0), vec3(0.0),
                   point.backfacing ? 1.0 / inside : inside, clamp(roughness, 0.0, 1.0), 0.0, default_tangent(n), n);
  }
  else {
    closure_transparent(closures, passing);
  }
}

// Specular term of Principled: the level scales the reflectance of the index of refraction, 0.5 leaves it.
void principled_specular(float ior, float level, vec3 tint, out vec3 f0, out float adjusted_ior)
{
  float base = dielectric_f0(ior);
  adjusted_ior = ior;
  if (level != 0.5) {
    base *= 2.0 * max(level, 0.0);
    float root = sqrt(clamp(base, 0.0, 0.99));
    adjusted_ior = (1.0 + root) / (1.0 - root);
    if (ior < 1.0) {
      adjusted_ior = 1.0 / adjusted_ior;
    }
  }
  f0 = clamp(base * tint, vec3(0.0), vec3(1.0));
}

// Coat of Principled; returns what it leaves for the layers below, with the absorption on the way through it.
vec3 principled_coat(inout Closures closures, SurfacePoint point, vec3 weight, float coat_weight, float coat_roughness,
                     float coat_ior, vec3 coat_tint, vec3 coat_normal)
{
  vec3 n = reflecting_normal(point, coat_normal);
  float ior = clamp(coat_ior, 1.0, MOST_IOR);
  float mu = view_cosine(point, n);
  vec3 whole = weight * coat_weight;
  bool grey = is_finite(whole.x) && largest(abs(whole - vec3(whole.x))) < 2e-3 * whole.x;
  vec3 albedo;
  if (COAT_APART && grey && closures.coat.x <= 0.0 && coat_is_thin(clamp(coat_roughness, 0.0, 1.0), ior)) {
    float roughness = clamp(coat_roughness, 0.0, 1.0);
    vec3 shown = glossy_albedo(FRESNEL_DIELECTRIC, vec3(dielectric_f0(ior)), vec3(1.0), ior, roughness, mu);
    closures.coat = vec4(whole.x, roughness, ior, useful_luminance(closures, shown));
    closures.coat_normal = n;
    albedo = whole * shown;
  }
  else {
    albedo = add_glossy(closures, point, whole, DISTRIBUTION_MULTI_GGX, FRESNEL_DIELECTRIC, vec3(dielectric_f0(ior)),
                        vec3(1.0), ior, clamp(coat_roughness, 0.0, 1.0), 0.0, default_tangent(n), n);
  }
  float cos_inside = sqrt(max(1.0 - (1.0 - mu * mu) / (ior * ior), 1e-6));
  vec3 absorption = pow(max(coat_tint, vec3(0.0)), vec3(1.0 / cos_inside));
  float covered = clamp(coat_weight, 0.0, 1.0);
  if (energy_is_fine()) {
    // As Cycles 5.3: the coat covers a share of the surface and reflects there as if its facets did not hide each other.
    float reflected = clamp(dielectric_layer_albedo(mu, clamp(coat_roughness, 0.0, 1.0), ior), 0.0, 1.0);
    return weight * mix(vec3(1.0), (1.0 - reflected) * absorption, covered);
  }
  return below_layer(weight, albedo) * mix(vec3(1.0), absorption, covered);
}

// Principled BSDF, from the top layer down: alpha, sheen, coat, emission, metal, transmission, specular, diffuse.
// Drawn simpler: light passes thin walls straight on.
void shader_principled(inout Closures closures, SurfacePoint point, vec3 weight, vec3 base_color, float metallic,
                       float roughness, float ior, float alpha, vec3 normal, float diffuse_roughness,
                       float specular_level, vec3 specular_tint, float anisotropy, float rotation, vec3 tangent,
                       float transmission, float dispersion, float abbe, float thin_wall, float subsurface,
                       vec3 subsurface_radius,
                       float subsurface_scale, float subsurface_ior, float subsurface_anisotropy,
                       int subsurface_method,
                       float coat_weight, float coat_roughness, float coat_ior, vec3 coat_tint,
                       vec3 coat_normal, float sheen_weight, float sheen_roughness, vec3 sheen_tint,
                       vec3 emission_color, float emission_strength, int distribution, float film_thickness, float film_ior)
{
  vec3 n = unit_or(normal, point.normal);
  vec3 mirror_normal = reflecting_normal(point, n);
  vec3 base = max(base_color, vec3(0.0));
  float r = clamp(roughness, 0.0, 1.0);
  float coverage = clamp(alpha, 0.0, 1.0);
  closure_transparent(closures, weight * (1.0 - coverage));
  vec3 w = weight * coverage;

  vec3 coat_n = unit_or(coat_normal, n);
  if (sheen_weight > SMALLEST_WEIGHT) {
    vec3 sheen_normal = unit_or(mix(n, coat_n, clamp(coat_weight, 0.0, 1.0)), n);
    vec3 albedo = add_sheen(closures, point, w * sheen_weight * max(sheen_tint, vec3(0.0)),
                            clamp(sheen_roughness, 0.0, 1.0), sheen_normal);
    w = below_layer(w, albedo);
  }
  if (coat_weight > SMALLEST_WEIGHT) {
    w = principled_coat(closures, point, w, coat_weight, coat_roughness, coat_ior, coat_tint, coat_n);
  }
  closure_emission(closures, w * emission_color * emission_strength);

  float stretch = lobe_anisotropy(anisotropy);
  vec3 t = (stretch > 0.0) ? rotated_tangent(tangent, mirror_normal, rotation) : default_tangent(mirror_normal);
  float metal = clamp(metallic, 0.0, 1.0);
  if (metal > SMALLEST_WEIGHT) {
    vec3 edge = clamp(specular_tint, vec3(0.0), vec3(1.0));
    if (film_thickness > FILM_LEAST) {
      Film film = film_on_metal(film_thickness, film_ior, min(base, vec3(1.0)), edge);
      add_film(closures, point, w * metal, distribution, film, FRESNEL_F82, min(base, vec3(1.0)), edge, ior, r, stretch, t,
               mirror_normal);
    }
    else {
      add_glossy(closures, point, w * metal, distribution, FRESNEL_F82, min(base, vec3(1.0)), edge, ior, r, stretch, t,
                 mirror_normal);
    }
    w *= 1.0 - metal;
  }
  float through = clamp(transmission, 0.0, 1.0);
  if (through > SMALLEST_WEIGHT) {
    if (thin_wall > 0.5) {
      shader_thin_wall(closures, point, w * through, base, max(specular_tint, vec3(0.0)), clamp(ior, 1.0, MOST_IOR), r,
                       mirror_normal, film_thickness, max(film_ior, 1e-5));
    }
    else if (dispersion > 0.0) {
      // A glass for each color: light that has passed one is of that color.
      vec3 indices = dispersed_index(clamp(ior, 1e-5, MOST_IOR), max(abbe, 1e-3) / dispersion);
      for (int k = 0; k < 3; k++) {
        vec3 color = vec3(float(k == 0), float(k == 1), float(k == 2));
        add_glass(closures, point, w * through * color, vec3(1.0), sqrt(min(base, vec3(1.0))),
                  max(specular_tint, vec3(0.0)), clamp(indices[k], 1e-5, MOST_IOR), r, mirror_normal, distribution,
                  film_thickness, max(film_ior, 1e-5));
      }
    }
    else {
      add_glass(closures, point, w * through, vec3(1.0), sqrt(min(base, vec3(1.0))), max(specular_tint, vec3(0.0)),
                clamp(ior, 1e-5, MOST_IOR), r, mirror_normal, distribution, film_thickness, max(film_ior, 1e-5));
    }
    w *= 1.0 - through;
  }
  if (largest(w) < SMALLEST_WEIGHT) {
    return;
  }
  vec3 f0;
  float specular_ior;
  principled_specular(clamp(ior, 1e-5, MOST_IOR), specular_level, max(specular_tint, vec3(0.0)), f0, specular_ior);
  if (film_thickness > FILM_LEAST) {
    Film film = film_on_dielectric(film_thickness, film_ior, specular_ior, f0);
    w = below_layer(w, add_film(closures, point, w, distribution, film, FRESNEL_DIELECTRIC, f0, vec3(1.0), specular_ior, r,
                                stretch, t, mirror_normal));
  }
  else if (specular_ior != 1.0) {
    vec3 albedo = add_glossy(closures, point, w, distribution, FRESNEL_DIELECTRIC, f0, vec3(1.0), specular_ior, r,
                             stretch, t, mirror_normal);
    w = below_layer(w, albedo);
  }
  if (thin_wall > 0.5 && subsurface > SMALLEST_WEIGHT) {
    // Light that scatters in a thin wall leaves on both sides, by the direction that it prefers.
    float forward = clamp(subsurface, 0.0, 1.0) * 0.5 * (1.0 + clamp(subsurface_anisotropy, -1.0, 1.0));
    add_soft(closures, LOBE_TRANSLUCENT, w * base * forward, 1.0, 0.0, vec3(1.0), n);
    w *= 1.0 - forward;
  }
  else if (subsurface > SMALLEST_WEIGHT) {
    add_subsurface(closures, point, w * clamp(subsurface, 0.0, 1.0), base, subsurface_radius * subsurface_scale,
                   (subsurface_method == 2) ? subsurface_ior : specular_ior, r, subsurface_anisotropy, n, subsurface_method);
  }
  closure_diffuse(closures, w, base, clamp(diffuse_roughness, 0.0, 1.0), n);
}
