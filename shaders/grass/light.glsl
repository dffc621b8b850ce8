// What grass reflects of light from a direction: a place's pictures under the four lights around that direction, each
// decoded, and their mean by the direction's weights. Grass shows its own shadows and cosine; only light that other things
// keep from it is asked for.
#include "grass/table.glsl"

// Whether layers of depth maps shadow what a pixel shows (lib/shadow.glsl).
#define LAYERS_SHADE(pixel) (lobe_kind(surface_lobe_fetch(pixel)) != SURFACE_GRASS)

struct GrassSeen {
  bool exists;
  Grass grass;
  GrassPlace place;
  int view;
  float contrast;
  float alike;  // of pictures under neighbouring lights
  float rise;   // cosine of the picture's view
  vec3 along_x;
  vec3 along_y;
};

// A direction in the tile.
vec3 grass_turned(GrassSeen seen, Surface s, vec3 direction)
{
  return safe_normalize(vec3(dot(direction, seen.along_x), dot(direction, seen.along_y), dot(direction, s.normal)));
}

GrassSeen grass_see(ivec2 pixel, Surface s)
{
  GrassSeen seen;
  seen.exists = s.kind == SURFACE_GRASS;
  vec4 lobe = seen.exists ? surface_lobe_fetch(pixel) : vec4(0.0);
  float axes = seen.exists ? surface_tint_fetch(pixel).w : 0.0;
  seen.grass = grass_of(seen.exists ? int(lobe.z - float(SURFACE_GRASS) * 2097152.0 + 0.5) : 0);
  int place = int(lobe.x + 0.5);
  seen.place = grass_place(seen.grass, place);
  seen.view = place / (seen.grass.side * seen.grass.side);
  seen.contrast = lobe.w;
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(s.normal, tangent, bitangent);
  vec2 of_x = grass_unpack(axes);
  vec2 of_y = grass_unpack(lobe.y);
  seen.along_x = of_x.x * tangent + of_x.y * bitangent;
  seen.along_y = of_y.x * tangent + of_y.y * bitangent;
  vec4 about = grass_texel(grass_picture(seen.grass, seen.view, seen.grass.lights + 1));
  seen.alike = about.y;
  seen.rise = about.z;
  return seen;
}

vec3 grass_under(GrassSeen seen, float light, float contrast)
{
  return grass_decoded(seen.grass, seen.place, seen.view, int(light + 0.5), contrast);
}

// The tile's mean under a light, in the tile, over that which pictures give.
vec3 grass_finer(GrassSeen seen, vec3 light)
{
  Grass g = seen.grass;
  if (g.finer_rings == 0) {
    return vec3(1.0);
  }
  vec4 low;
  vec4 high;
  float outer = grass_rings(g.entry + GRASS_FINER_RINGS, g.finer_rings, light, low, high);
  vec3 inside = grass_azimuths(low, light);
  vec3 outside = grass_azimuths(high, light);
  int first = grass_places(g) + GRASS_PLACE * g.views * g.side * g.side + seen.view * g.finer;
  vec3 near = mix(grass_texel(first + int(inside.x + 0.5)).rgb, grass_texel(first + int(inside.y + 0.5)).rgb, inside.z);
  vec3 far = mix(grass_texel(first + int(outside.x + 0.5)).rgb, grass_texel(first + int(outside.y + 0.5)).rgb, outside.z);
  return mix(near, far, outer);
}

// Radiance for unit irradiance on a plane that faces the light.
vec3 grass_reflection(GrassSeen seen, Surface s, vec3 direction)
{
  Grass g = seen.grass;
  float rise = dot(direction, s.normal);
  if (rise <= 0.0) {
    return vec3(0.0);
  }
  vec3 light = grass_turned(seen, s, direction);
  vec4 low;
  vec4 high;
  float outer = grass_rings(g.entry + GRASS_LIGHT_RINGS, g.light_rings, light, low, high);
  vec3 inside = grass_azimuths(low, light);
  vec3 outside = grass_azimuths(high, light);
  float squares = grass_squares(outer, inside.z, outside.z);
  float contrast = seen.contrast * grass_contrast(squares, seen.alike);
  // Leaves that scatter once send i / (i + v), with i and v the cosines of light and view (Lommel and Seeliger); a plane sends i.
  // Between two rings of lights the view's mean follows i / (i + v)^p, and what is interpolated is how far pictures are from that.
  vec3 near = (1.0 - inside.z) * grass_under(seen, inside.x, contrast) + inside.z * grass_under(seen, inside.y, contrast);
  vec3 far = (1.0 - outside.z) * grass_under(seen, outside.x, contrast) + outside.z * grass_under(seen, outside.y, contrast);
  float cos_low = cos(radians(low.x));
  float cos_high = cos(radians(high.x));
  vec4 powers = grass_texel(grass_picture(g, seen.view, g.lights + 1) + 1);
  float power = dot(powers, vec4(equal(ivec4(0, 1, 2, 3), ivec4(int(low.w + 0.5)))));
  float law_low = pow((cos_low + seen.rise) / (light.z + seen.rise), power);
  float law_high = pow((cos_high + seen.rise) / (light.z + seen.rise), power);
  vec3 sum = (1.0 - outer) * law_low / cos_low * near + outer * law_high / cos_high * far;
  return sum * grass_finer(seen, light) * (rise / PI);
}
