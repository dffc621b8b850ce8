// What grass reflects of light from a direction: a place's pictures under the four lights around that direction, each
// decoded, and their mean by the direction's weights. Grass shows its own shadows and cosine; only light that other things
// keep from it is asked for.
#include "grass/table.glsl"

struct GrassSeen {
  bool exists;
  Grass grass;
  GrassPlace place;
  int view;
  float contrast;
  vec3 along;
  vec3 across;
};

GrassSeen grass_see(ivec2 pixel, Surface s)
{
  GrassSeen seen;
  seen.exists = s.kind == SURFACE_GRASS;
  vec4 lobe = seen.exists ? surface_lobe_fetch(pixel) : vec4(0.0);
  float turn = seen.exists ? surface_tint_fetch(pixel).w : 0.0;
  seen.grass = grass_of(int(lobe.y + 0.5));
  int place = int(lobe.x + 0.5);
  seen.place = grass_place(seen.grass, place);
  seen.view = place / (seen.grass.side * seen.grass.side);
  seen.contrast = lobe.w;
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(s.normal, tangent, bitangent);
  seen.along = cos(turn) * tangent + sin(turn) * bitangent;
  seen.across = cross(s.normal, seen.along);
  return seen;
}

vec3 grass_under(GrassSeen seen, float light, float contrast)
{
  return grass_decoded(seen.grass, seen.place, seen.view, int(light + 0.5), contrast);
}

// Radiance for unit irradiance on a plane that faces the light.
vec3 grass_reflection(GrassSeen seen, Surface s, vec3 direction)
{
  Grass g = seen.grass;
  float rise = dot(direction, s.normal);
  if (rise <= 0.0) {
    return vec3(0.0);
  }
  vec3 light = grass_unstretched(g, vec3(dot(direction, seen.along), dot(direction, seen.across), rise));
  vec4 low;
  vec4 high;
  float outer = grass_rings(g.entry + GRASS_LIGHT_RINGS, g.light_rings, light, low, high);
  vec3 inside = grass_azimuths(low, light);
  vec3 outside = grass_azimuths(high, light);
  float alike = grass_texel(grass_picture(g, seen.view, g.lights + 1)).y;
  float squares = grass_squares(outer, inside.z, outside.z);
  float contrast = seen.contrast * grass_contrast(squares, alike);
  // What does not depend on the light's cosine is what varies little between lights.
  vec3 near = (1.0 - inside.z) * grass_under(seen, inside.x, contrast) + inside.z * grass_under(seen, inside.y, contrast);
  vec3 far = (1.0 - outside.z) * grass_under(seen, outside.x, contrast) + outside.z * grass_under(seen, outside.y, contrast);
  vec3 sum = (1.0 - outer) / cos(radians(low.x)) * near + outer / cos(radians(high.x)) * far;
  return sum * (rise / PI);
}
