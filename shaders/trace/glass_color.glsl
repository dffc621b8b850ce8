// Colour of glass where a ray meets it, for who follows light from interface to interface: of triangles whose opacity was
// measured (addon/scene/opacity_maps.py) their own. What includes this has trace/hierarchy.glsl.
#include "lib/closure.glsl"

// Of what passes once. Elsewhere `mean`. `share` of the material is glass, with Fresnel's losses or without.
vec3 glass_color(ivec2 hit, vec3 position, vec3 mean, float ior, float share, bool fresnel)
{
#ifdef TINTED_LAYERS
  int base = hit.x * LEAF_TEXELS;
  int k = HIT_SLOT(hit);
  vec3 told = vec3(leaf_texel(base + EMISSION_TEXEL)[k], leaf_texel(base + EMISSION_TEXEL + 1)[k],
                   leaf_texel(base + EMISSION_TEXEL + 2)[k]);
  if (told.x == STAINED && told.y != 0.0) {
    float code = abs(leaf_texel(base + OPACITY_TEXEL)[k]);
    float sides = mod(code, SIDES * SIDES);
    float opacity = mod(sides, SIDES);  // of light from all sides; of a sheet, of what meets one of its sides
    opacity = (triangle_is_sheet(hit) ? min(opacity, floor(sides / SIDES)) : opacity) / (SIDES - 1.0);  // from outside
#ifdef OPACITY_TILES
    if (code >= MAPPED * SIDES * SIDES) {
      opacity = 0.5 * (tile_opacity(hit, sides, true, false, position) + tile_opacity(hit, sides, false, false, position));
    }
#endif
    float losses = fresnel ? fresnel_average_dielectric(max(ior, 1.0 / ior)) : 0.0;
    return told_tint(hit, told, position, vec3(1.0)) * (1.0 - opacity) / max(share * (1.0 - losses), 1e-3);
  }
#endif
  return mean;
}
