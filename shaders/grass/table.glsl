// Reads grass patches from `grass_table`, which addon/grass/table.py lays out: half floats, 2048 texels a row.
//
// ENTRY texels for each material that shows a patch: 0: first row of the patch, texels along its side, views, lights;
// 1: side of the tile and height of the blades, m; density; rings of finer lights;
// 2: F_max, height over side of the patch's own tile, rings of views, rings of lights; from 3 on eight rings of views
// (polar angle in degrees, azimuths, first view, mean height 0..1), from 11 on five rings of lights (w: their number);
// 16: first row of a map of the density, its width and height in texels, and the side in metres of the square it covers, 0: none;
// 17: 1 where places show the tile shifted at random; tiles along the unit of a UV map, 0: along the object's axes; finer lights;
// 18: as 16, of a map that the height is multiplied by. On UV maps both cover the unit square. From 19 on eight rings of lights
// of which the tile's mean alone is known.
// A patch: PICTURE texels for each view and light, and one light more, the uniform sky (coefficients of luma, of chroma, mean
// colour and contrast, ratio of means; w: what cutting off adds to the mean where contrast is doubled), and as many of the view:
// the correlation of its pictures with those of neighbouring views, among neighbouring lights, the cosine of its polar angle,
// and the first of these from far away; then, for each pair of rings of lights, the power of Lommel and Seeliger's law between
// them. Then PLACE texels for each view and place; then, for each view and finer light, the mean there over that which pictures
// give. How they are decoded: addon/grass/compression.py.
#include "lib/math.glsl"

#define GRASS_ENTRY 27
#define GRASS_PICTURE 5
#define GRASS_PLACE 4
#define GRASS_VIEW_RINGS 3
#define GRASS_LIGHT_RINGS 11
#define GRASS_MAP 16
#define GRASS_VARIED 17
#define GRASS_HEIGHT_MAP 18
#define GRASS_FINER_RINGS 19
#define GRASS_MOST_RINGS 8
#define GRASS_GAMMA 2.2
#define GRASS_CUT 2.3  // what cutting off takes from the contrast, over what it adds to the mean

struct Grass {
  int base;      // of the patch, in texels
  int entry;
  int side;      // texels
  int views;
  int lights;    // without the sky
  float size;    // of the tile, m, where no UV map says it
  float height;  // of the plane on top, m
  float density;
  float tiles;   // along the unit of a UV map; 0: along the object's axes
  float white;
  float slope;   // height over side of the tile that was rendered
  int view_rings;
  int light_rings;
  int finer_rings;
  int finer;
};

vec4 grass_texel(int index)
{
  return grass_table_fetch(ivec2(index & 2047, index >> 11));
}

Grass grass_of(int entry)
{
  Grass g;
  g.entry = entry * GRASS_ENTRY;
  vec4 a = grass_texel(g.entry);
  vec4 b = grass_texel(g.entry + 1);
  vec4 c = grass_texel(g.entry + 2);
  g.base = int(a.x + 0.5) * 2048;
  g.side = int(a.y + 0.5);
  g.views = int(a.z + 0.5);
  g.lights = int(a.w + 0.5);
  g.size = b.x;
  g.height = b.y;
  g.density = b.z;
  g.finer_rings = int(b.w + 0.5);
  vec4 placed = grass_texel(g.entry + GRASS_VARIED);
  g.tiles = placed.y;
  g.finer = int(placed.z + 0.5);
  g.white = c.x;
  g.slope = c.y;
  g.view_rings = int(c.z + 0.5);
  g.light_rings = int(c.w + 0.5);
  return g;
}

float grass_map_texel(int base, ivec2 size, ivec2 texel)
{
  ivec2 at = clamp(texel, ivec2(0), size - 1);
  return grass_texel(base + at.y * size.x + at.x).x;
}

// What a map has at a place of the ground, in tiles; 1 without a map. Beyond it its rim goes on.
float grass_map(Grass g, int which, vec2 place)
{
  vec4 map = grass_texel(g.entry + which);
  if (map.w <= 0.0) {
    return 1.0;
  }
  int base = int(map.x + 0.5) * 2048;
  ivec2 size = ivec2(map.yz + 0.5);
  vec2 at = (g.tiles > 0.0) ? place / g.tiles : place * (g.size / map.w) + 0.5;
  vec2 texel = clamp(at, vec2(0.0), vec2(1.0)) * vec2(size) - 0.5;
  ivec2 low = ivec2(floor(texel));
  vec2 f = texel - floor(texel);
  float below = mix(grass_map_texel(base, size, low), grass_map_texel(base, size, low + ivec2(1, 0)), f.x);
  float above = mix(grass_map_texel(base, size, low + ivec2(0, 1)), grass_map_texel(base, size, low + ivec2(1, 1)), f.x);
  return mix(below, above, f.y);
}

// The two rings around a direction in the tile's frame, and how far it is from the first to the second.
float grass_rings(int first, int count, vec3 direction, out vec4 low, out vec4 high)
{
  float polar = degrees(acos(clamp(direction.z, -1.0, 1.0)));
  low = grass_texel(first);
  high = low;
  for (int k = 1; k < GRASS_MOST_RINGS; k++) {
    if (k < count) {
      vec4 next = grass_texel(first + k);
      if (k == 1 || polar > high.x) {
        low = high;
        high = next;
      }
    }
  }
  return (high.x > low.x) ? clamp((polar - low.x) / (high.x - low.x), 0.0, 1.0) : 0.0;
}

// Where among the azimuths of a ring: x the one before, y the one behind, z how far from the first to the second.
vec3 grass_azimuths(vec4 ring, vec3 direction)
{
  float turn = (abs(direction.x) + abs(direction.y) > 1e-9) ? atan(direction.y, direction.x) / (2.0 * PI) : 0.0;
  float place = fract(turn) * ring.y;
  float before = min(floor(place), ring.y - 1.0);
  float behind = (before + 1.5 > ring.y) ? 0.0 : before + 1.0;
  return vec3(ring.z + before, ring.z + behind, clamp(place - before, 0.0, 1.0));
}

vec3 grass_ring_direction(vec4 ring, float number)
{
  float azimuth = 2.0 * PI * (number - ring.z) / ring.y;
  float polar = radians(ring.x);
  return vec3(sin(polar) * cos(azimuth), sin(polar) * sin(azimuth), cos(polar));
}

// What a direction is beside the tile that was rendered. `across_ground`: how far along the tile's axes, in tiles a metre, and
// `rise`: how far up it goes; blades are `height` m high.
vec3 grass_in_tile(Grass g, vec2 across_ground, float rise, float height)
{
  return safe_normalize(vec3(across_ground, rise * g.slope / max(height, 1e-20)));
}

// Two numbers in one that has 24 bits, finest about 0.
#define GRASS_PACKED 4095.0

float grass_pack(vec2 value)
{
  vec2 kept = floor((0.5 + 0.5 * value / (1.0 + abs(value))) * GRASS_PACKED + 0.5);
  return kept.x + (GRASS_PACKED + 1.0) * kept.y;
}

vec2 grass_unpack(float held)
{
  float y = floor(held / (GRASS_PACKED + 1.0));
  vec2 kept = vec2(held - (GRASS_PACKED + 1.0) * y, y) * (2.0 / GRASS_PACKED) - 1.0;
  return kept / max(1.0 - abs(kept), vec2(1e-4));
}

// What a place shows of all lights: mean and components.
struct GrassPlace {
  vec4 mean;  // encoded; w: height 0..1 of what is seen
  vec4 luma0;
  vec4 luma1;
  vec4 chroma;
};

// Of a view: the first texel of one of its lights, of the sky (light: their number), or of what follows that.
int grass_picture(Grass g, int view, int light)
{
  return g.base + GRASS_PICTURE * (view * (g.lights + 2) + light);
}

int grass_places(Grass g)
{
  return g.base + GRASS_PICTURE * g.views * (g.lights + 2);
}

GrassPlace grass_place(Grass g, int place)
{
  int index = grass_places(g) + GRASS_PLACE * place;
  GrassPlace found;
  found.mean = grass_texel(index);
  found.luma0 = grass_texel(index + 1);
  found.luma1 = grass_texel(index + 2);
  found.chroma = grass_texel(index + 3);
  return found;
}

// F of a place under one of the lights, or the sky: the picture's mean colour, and how far from it by `contrast`.
vec3 grass_decoded(Grass g, GrassPlace place, int view, int light, float contrast)
{
  int index = grass_picture(g, view, light);
  vec4 c0 = grass_texel(index);
  vec4 c1 = grass_texel(index + 1);
  vec4 c2 = grass_texel(index + 2);
  vec4 mean = grass_texel(index + 3);
  vec4 ratio = grass_texel(index + 4);
  float luma = place.mean.x + dot(place.luma0, c0) + dot(place.luma1, c1);
  float blue = luma + place.mean.y + dot(place.chroma.xy, c2.xy);
  float red = luma + place.mean.z + dot(place.chroma.zw, c2.zw);
  float green = (luma - 0.2126 * red - 0.0722 * blue) / 0.7152;
  vec3 shown = g.white * pow(max(vec3(red, green, blue), vec3(0.0)), vec3(GRASS_GAMMA)) * ratio.rgb;
  // Where more contrast makes places darker than black, these are black, and all are darker, so that the mean stays.
  float more = mean.w * contrast;
  float excess = ratio.w * pow(max(more - 1.0, 0.0), 1.5);
  more *= 1.0 + GRASS_CUT * excess;
  return max(mean.rgb + (shown - mean.rgb) * more, vec3(0.0)) / (1.0 + excess);
}

// What a mean of pictures whose squared weights sum to this loses of their contrast, where they are as alike as that.
float grass_contrast(float squares, float alike)
{
  return inversesqrt(max(squares + alike * (1.0 - squares), 1e-3));
}

// The sum of squared weights of four directions on two rings.
float grass_squares(float outer, float inside, float outside)
{
  float inner_share = (1.0 - outer) * (1.0 - outer) * ((1.0 - inside) * (1.0 - inside) + inside * inside);
  return inner_share + outer * outer * ((1.0 - outside) * (1.0 - outside) + outside * outside);
}
