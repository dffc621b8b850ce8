// Means of what a material reflects: over a cell of pixels, each of which shows some point of it. Bands of rows hold, one
// above the other, all of it, with `mirrors_photons`, its diffuse part, with that times the mirror's own alpha, and of its
// lobe the reflectance at normal incidence, with alpha, and at grazing incidence, with the roughness of the diffuse part.
// Then three for how normal maps and bumps turn normals n to n + d: rows of the mean of d n^T, with the diagonal of that
// of n n^T, and the latter's yz, zx, xy, with a dielectric's index of refraction. Both are the same from behind. Last, what
// of the diffuse part passes to the other side.
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "indirect/albedo.glsl"

// 1 for glass and mirrors of a material that throws caustics (`mirrors`): photons bring their light where a technique owns it.
// `alpha`: of the mirror.
float mirrors_photons(Surface s, Reflection r, out float alpha)
{
  bool glass = s.kind == LOBE_REFRACTION;
  bool mirror = mirrors != 0 && s.kind < LOBE_REFRACTION && luminance(r.grazing) > 0.0 && s.glossy_roughness <= THROWS
                && luminance(r.straight) >= luminance(r.diffuse);
  vec2 alphas = lobe_alpha(s.glossy_roughness, s.glossy_anisotropy);
  alpha = mirror ? sqrt(alphas.x * alphas.y) : 0.0;
  return (mirror || glass) ? 1.0 : 0.0;
}

void main()
{
  int band = int(gl_FragCoord.y) / rows;
  ivec2 corner = (ivec2(gl_FragCoord.xy) - ivec2(0, band * rows)) * ivec2(extent);
  vec4 sum = vec4(0.0);
  float count = 0.0;
  for (int y = 0; y < extent.y; y++) {
    for (int x = 0; x < extent.x; x++) {
      ivec2 pixel = corner + ivec2(x, y);
      if (surface_position_fetch(pixel).w != 0.0) {
        Surface s = SURFACE_READ(pixel);
        Reflection r = surface_reflection(s, view_cosine);
        vec3 base = s.base_normal;
        vec3 moved = s.normal - base;
        float alpha;
        float photons = mirrors_photons(s, r, alpha);
        sum += (band > 7) ? vec4(r.through * r.diffuse, 0.0)
             : (band > 6) ? vec4(base.yzx * base.zxy, (s.kind == FRESNEL_DIELECTRIC) ? s.glossy_ior : 0.0)
             : (band > 3) ? vec4(moved[band - 4] * base, base[band - 4] * base[band - 4])
             : (band == 0) ? vec4(surface_albedo(s, view_cosine), photons)
             : (band == 1) ? vec4(r.diffuse, photons * alpha)
             : (band == 2) ? vec4(r.straight, r.alpha)
                           : vec4(r.grazing, r.rough);
        count += 1.0;
      }
    }
  }
  out_reflectance = sum / max(count, 1.0);
}
