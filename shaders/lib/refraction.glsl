// The interface of a rough dielectric: GGX reflection and transmission after Walter et al., "Microfacet models for
// refraction through rough surfaces", EGSR 2007. With v towards the viewer, l where light comes from, n the normal and
// eta the index of refraction of l's side over that of v's side, for l on the other side
//
//   h = -+(v + eta l), normalised, up        f |n.l| = (1 - F) D G2 eta^2 (v.h) |l.h| / (n.v ((v.h) + eta (l.h))^2)
//
// which is equation 21 without its division by eta^2: like Cycles, radiance does not change with the medium, so that a
// beam that leaves again is as bright as it came. Values are f |cos|, densities per steradian of l.
#include "lib/math.glsl"
#include "lib/energy.glsl"
#include "lib/brdf.glsl"

struct Interface {
  vec3 tangent;
  vec3 bitangent;
  vec3 normal;      // on the viewer's side
  float alpha;
  float ior;        // of the other side over this one
  vec3 tint;        // reflectance at normal incidence
  bool fresnel;     // false: only total reflection takes from what passes
  vec3 transmitted; // colour of what passes, with the factor for multiple scattering
  vec3 reflected;   // of what is mirrored; the caller may leave that to another lobe
  vec3 view;        // in the interface's frame
};

Interface interface_begin(vec3 normal, vec3 view, float roughness, float ior, vec3 tint, bool fresnel, vec3 transmitted,
                          vec3 reflected)
{
  Interface surface;
  orthonormal_basis(normal, surface.tangent, surface.bitangent);
  surface.normal = normal;
  surface.alpha = roughness * roughness;
  surface.ior = ior;
  surface.tint = tint;
  surface.fresnel = fresnel;
  surface.transmitted = transmitted;
  surface.reflected = reflected;
  surface.view = vec3(dot(view, surface.tangent), dot(view, surface.bitangent), dot(view, normal));
  return surface;
}

// Turned by the edit of what the picture shows, where it has no other side: light is bent from elsewhere.
Interface interface_edited(Interface surface, Surface s)
{
#ifdef HAS_SURFACE_EDIT
  if (surface_is_edited(s) && !edits_what_leaves(s)) {
    surface.tangent = quaternion_turned(s.edit, surface.tangent);
    surface.bitangent = quaternion_turned(s.edit, surface.bitangent);
    surface.normal = quaternion_turned(s.edit, surface.normal);
  }
#endif
  return surface;
}

vec3 interface_to_world(Interface surface, vec3 v)
{
  return safe_normalize(v.x * surface.tangent + v.y * surface.bitangent + v.z * surface.normal);
}

bool interface_is_smooth(Interface surface)
{
  return surface.alpha * surface.alpha <= MIRROR_ALPHA;
}

// Share that is mirrored at a facet.
vec3 interface_reflectance(Interface surface, float cos_h)
{
  if (!surface.fresnel) {
    return vec3((fresnel_dielectric(cos_h, surface.ior) >= 1.0) ? 1.0 : 0.0);
  }
  return fresnel_reflectance(FRESNEL_DIELECTRIC, surface.tint, vec3(1.0), surface.ior, cos_h);
}

// Chance with which a walk is mirrored at a facet; 0 where another lobe holds what is mirrored.
float interface_mirror_chance(Interface surface, vec3 mirrored)
{
  return (max_component(surface.reflected) > 0.0) ? clamp(luminance(mirrored), 0.0, 1.0) : 0.0;
}

vec3 interface_value(Interface surface, vec3 light_world, out float density)
{
  density = 0.0;
  vec3 view = surface.view;
  vec3 light = vec3(dot(light_world, surface.tangent), dot(light_world, surface.bitangent),
                    dot(light_world, surface.normal));
  if (view.z <= 0.0 || light.z == 0.0 || interface_is_smooth(surface)) {
    return vec3(0.0);
  }
  bool passes = light.z < 0.0;
  vec3 sum = passes ? -(view + surface.ior * light) : view + light;
  float length_squared = dot(sum, sum);
  vec3 h = sum * inversesqrt(max(length_squared, 1e-30));
  h = (h.z < 0.0) ? -h : h;
  float view_h = dot(view, h);
  float light_h = dot(light, h);
  if (length_squared < 1e-12 || view_h <= 0.0 || (passes ? light_h >= 0.0 : light_h <= 0.0)) {
    return vec3(0.0);
  }
  vec2 alpha = vec2(surface.alpha);
  float lambda_view = ggx_lambda(view, alpha);
  float jacobian = passes ? surface.ior * surface.ior * view_h * -light_h / length_squared : 0.25;
  float facet = ggx_distribution(h, alpha) * jacobian / view.z;
  vec3 mirrored = interface_reflectance(surface, view_h);
  float chance = interface_mirror_chance(surface, mirrored);
  density = facet / (1.0 + lambda_view) * (passes ? 1.0 - chance : chance);
  vec3 color = passes ? surface.transmitted * (1.0 - mirrored) : surface.reflected * mirrored;
  return color * (facet / (1.0 + lambda_view + ggx_lambda(light, alpha)));
}

// As interface_sample, where `strata` numbers, one in each of as many parts of 0..1, choose for one photon after the other:
// chances are whole numbers of them, so that each path is drawn as often as it should be. 0: choices are free. Below 0 there
// is one choice for all: what the photon does not do is lost.
vec3 interface_sample_strata(Interface surface, vec2 u, float choice, float strata, out vec3 weight)
{
  vec3 view = surface.view;
  vec3 h = vec3(0.0, 0.0, 1.0);
  bool smooth_surface = interface_is_smooth(surface);
  if (!smooth_surface) {
    h = visible_normal(view, vec2(surface.alpha), u);
  }
  float view_h = dot(view, h);
  vec3 mirrored = interface_reflectance(surface, view_h);
  float chance = interface_mirror_chance(surface, mirrored);
  if (strata > 0.0 && chance < 1.0) {
    chance = min(ceil(chance * strata), strata - 1.0) / strata;
  }
  bool passes = choice >= chance;
  float passing = max(1.0 - chance, 1e-6);
  float mirroring = max(chance, 1e-6);
  if (strata < 0.0) {
    passing = mirroring = 1.0;
  }
  float squared = 1.0 - (1.0 - view_h * view_h) / (surface.ior * surface.ior);
  vec3 bent = (view_h / surface.ior - sqrt(max(squared, 0.0))) * h - view / surface.ior;
  vec3 light = passes ? bent : 2.0 * view_h * h - view;
  weight = vec3(0.0);
  if (view.z > 0.0 && view_h > 0.0 && (passes ? light.z < 0.0 && squared > 0.0 : light.z > 0.0)) {
    vec2 alpha = vec2(surface.alpha);
    float lambda_view = smooth_surface ? 0.0 : ggx_lambda(view, alpha);
    float lambda_light = smooth_surface ? 0.0 : ggx_lambda(light, alpha);
    vec3 color = passes ? surface.transmitted * (1.0 - mirrored) / passing :
                          surface.reflected * mirrored / mirroring;
    weight = color * ((1.0 + lambda_view) / (1.0 + lambda_view + lambda_light));
  }
  return interface_to_world(surface, light);
}

// A direction drawn from the interface by visible normals, mirrored or bent by `choice`; `weight` =
// f |cos| / density for it. Zero weight where it would leave on the wrong side.
vec3 interface_sample(Interface surface, vec2 u, float choice, out vec3 weight)
{
  return interface_sample_strata(surface, u, choice, 0.0, weight);
}
