// Collects what of a surface's diffuse light enters it elsewhere, and how far from there: as Cycles reads the settings of
// its three methods, whose names these are. Anisotropy g is taken up by similarity: an isotropic walk with the mean free
// path 1 / (sigma_t - g sigma_s).
#include "subsurface/profile.glsl"

#define METHOD_BURLEY 0
#define METHOD_RANDOM_WALK 1
#define METHOD_SKIN 2
#define METHOD_LEGACY 3

// Of two methods radii are sizes that look alike: a quarter of one over pi is Burley's d, or a mean free path. Those of the
// random walk (since Blender 5.2) are mean free paths, and those for skin the diffuse ones.
#define FREE_PATH (0.25 / PI)

// sqrt(3 (1 - alpha)) of the dipole with this total: by what the method for skin multiplies radii. alpha is the last of
// Cycles' twelve bisections, whose result at a colour of .9 is a fifth away from their limit.
float skin_scale(float albedo, float ior)
{
  float internal = -1.440 / (ior * ior) + 0.710 / ior + 0.668 + 0.0636 * ior;
  float slope = 4.0 / 3.0 * (1.0 + internal) / (1.0 - internal);
  float low = 0.0;
  float high = 1.0;
  float middle = 0.5;
  for (int i = 0; i < 12; i++) {
    middle = 0.5 * (low + high);
    float s = sqrt(3.0 * (1.0 - middle));
    bool below = 0.5 * middle * (1.0 + exp(-slope * s)) * exp(-s) < albedo;
    low = below ? middle : low;
    high = below ? high : middle;
  }
  return sqrt(3.0 * (1.0 - ((albedo < 0.995) ? middle : 0.999999)));
}

// Cosine inside at which the view's ray enters: refracted where the surface is smooth. Of a rough one a mean that gives what
// Cycles returns of walks that enter at 0 to 86 degrees, whatever the index of refraction.
float entry_cosine(float cosine, float ior, float roughness)
{
  float refracted = sqrt(max(1.0 - (1.0 - cosine * cosine) / (ior * ior), 0.0));
  return mix(refracted, 0.15 + 0.78 * cosine, roughness * roughness);
}

void closure_subsurface(inout Closures c, vec3 weight, vec3 color, vec3 radius, float ior, float roughness,
                        float anisotropy, float cosine, int method)
{
  vec3 albedo = weight * color;
  float added = min(dot(albedo, vec3(1.0)), 1e30);
  vec3 path = max(radius, vec3(0.0));
  if (!(added > 0.0) || !is_finite(path.x + path.y + path.z)) {
    return;
  }
  vec3 a = clamp(color, vec3(0.0), vec3(1.0));
  float index = clamp(ior, 1.01, 3.8);
  float g = clamp(anisotropy, -0.99, 0.9);
  if (method == METHOD_SKIN) {
    path *= vec3(skin_scale(a.x, index), skin_scale(a.y, index), skin_scale(a.z, index));
  }
  else if (method == METHOD_RANDOM_WALK) {
    vec3 s = walk_absorption(a);
    path *= (vec3(1.0) - g * s * s) / (1.0 - g);
  }
  else {
    path *= FREE_PATH;
  }
  c.scatter += albedo;
  c.scatter_length += albedo * path;
  c.scatter_color += albedo * a;
  if (added > c.scatter_most) {
    c.scatter_most = added;
    c.scatter_method = (method == METHOD_LEGACY) ? SCATTER_WALK : method;
    float rough = (method == METHOD_SKIN) ? 1.0 : clamp(roughness, 0.0, 1.0);
    c.scatter_entry = entry_cosine(cosine, index, rough);
    c.scatter_alpha = rough * rough;
    c.scatter_ior = index;
  }
}
