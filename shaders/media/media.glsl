// Media of the scene: what each does with light at a point, and what a ray loses on its way through them.
//
// `media_table` (addon/scene/media.py) holds MEDIUM_TEXELS per medium; what varies stands on grids of cells, of one layout in
// three images: extinction with anisotropy (above the table, in its image), scattering, emission. A grid is read at one cell, drawn around the point with
// the weights of trilinear interpolation: a mean over samples is the interpolated value for an eighth of the fetches.
// MEDIA_WORLD, MEDIA_BOUNDED, MEDIA_BOXES, MEDIA_GRIDS, MEDIA_ONE_LOBE say which kinds of media there are; others are not compiled.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "media/boundary.glsl"

#define MARCH_STEPS 192      // at most, of a ray through one medium's grid
#define FARTHEST_MEDIUM 1e29

struct Medium {
  vec3 extinction;
  float grid;  // above 0.5: coefficients stand on a grid
  vec3 scattering;
  float anisotropy;
  vec3 emission;
  int phase;
  vec4 phase_values;
};

vec4 medium_texel(int medium, int k)
{
  return media_table_fetch(ivec2(medium * MEDIUM_TEXELS + k, 0));
}

Medium medium_read(int medium)
{
  vec4 a = medium_texel(medium, 0);
  vec4 b = medium_texel(medium, 1);
  vec4 c = medium_texel(medium, 2);
  Medium m;
  m.extinction = a.rgb;
  m.grid = a.w;
  m.scattering = b.rgb;
  m.anisotropy = b.w;
  m.emission = c.rgb;
  m.phase = int(c.w);
  m.phase_values = medium_texel(medium, 3);
  return m;
}

float media_random(inout uint seed)
{
  seed = seed * 747796405u + 2891336453u;
  uint word = ((seed >> ((seed >> 28u) + 4u)) ^ seed) * 277803737u;
  return to_unit((word >> 22u) ^ word);
}

#ifdef MEDIA_GRIDS
// The texel of a cell beside a point, drawn by the weights of interpolation.
ivec2 medium_cell(int medium, vec3 position, inout uint seed)
{
  vec4 place = vec4(position, 1.0);
  vec3 cell = vec3(dot(medium_texel(medium, 4), place), dot(medium_texel(medium, 5), place),
                   dot(medium_texel(medium, 6), place));
  vec4 layout_ = medium_texel(medium, 7);
  vec3 roll = vec3(media_random(seed), media_random(seed), media_random(seed));
  ivec3 size = ivec3(layout_.xyz);
  ivec3 at = clamp(ivec3(floor(cell - 0.5 + roll)), ivec3(0), size - 1);
  int index = (at.z * size.y + at.y) * size.x + at.x;
  return ivec2(index & 2047, int(layout_.w) + (index >> 11));
}

float medium_cell_size(int medium)
{
  return medium_texel(medium, 8).x;
}

// Of medium_cell in the images of scattering and emission.
ivec2 medium_first_row(int medium)
{
  return ivec2(0, int(medium_texel(medium, 8).y));
}
#endif

#ifdef MEDIA_GRIDS
// Optical depth of a medium on a grid. Steps are even and the grid is shifted as a whole, both by numbers of the ray
// (media_turn), so that each layer of cells that it crosses is met by one step at least: with numbers of their own, steps
// would miss a fifth of walls that are one cell thick.
vec4 media_turn;

void media_turn_by(inout uint seed)
{
  media_turn = vec4(media_random(seed), media_random(seed), media_random(seed), media_random(seed));
}

vec3 medium_grid_depth(int medium, vec3 origin, vec3 direction, float from, float to)
{
  vec4 row_x = medium_texel(medium, 4);
  vec4 row_y = medium_texel(medium, 5);
  vec4 row_z = medium_texel(medium, 6);
  vec4 layout_ = medium_texel(medium, 7);
  ivec3 last = ivec3(layout_.xyz) - 1;
  vec3 way = vec3(dot(row_x.xyz, direction), dot(row_y.xyz, direction), dot(row_z.xyz, direction));
  vec3 start = vec3(dot(row_x, vec4(origin, 1.0)), dot(row_y, vec4(origin, 1.0)), dot(row_z, vec4(origin, 1.0)));
  float steps = clamp(ceil(max_component(abs(way)) * (to - from)), 1.0, float(MARCH_STEPS));
  float step_length = (to - from) / steps;
  start += media_turn.xyz - 0.5 + (from + media_turn.w * step_length) * way;
  way *= step_length;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < int(steps); i++) {
    vec3 place = start + float(i) * way;
#ifdef MEDIA_TURNS_APART
    // Each step shifts the grid by itself: the mean over them is smooth, which a guide has to be.
    place += fract(media_turn.xyz + float(i + 1) * vec3(0.8191725, 0.6710436, 0.5497005)) - media_turn.xyz;
#endif
    ivec3 at = ivec3(clamp(floor(place), vec3(0.0), vec3(last)));
    int index = (at.z * (last.y + 1) + at.y) * (last.x + 1) + at.x;
    sum += media_table_fetch(ivec2(index & 2047, int(layout_.w) + (index >> 11))).rgb;
  }
  return sum * step_length;
}
#endif

// Optical depth of the media `inside` between two places of a ray.
vec3 media_depth(uint inside, vec3 origin, vec3 direction, float from, float to)
{
  vec3 depth = vec3(0.0);
  while (inside != 0u) {
    int medium = findLSB(inside);
    inside &= inside - 1u;
    vec4 even = medium_texel(medium, 0);
#ifdef MEDIA_GRIDS
    if (even.w > 0.5) {
      depth += medium_grid_depth(medium, origin, direction, from, to);
      continue;
    }
#endif
    depth += even.rgb * (to - from);
  }
  return depth;
}

// The share of light that passes from the ray's start to `limit`, of the ray whose crossings were asked for last.
vec3 media_transmittance_known(vec3 origin, vec3 direction, float limit, uint salt)
{
  vec3 depth = vec3(0.0);
#ifdef MEDIA_GRIDS
  uint seed = salt;
  media_turn_by(seed);
#endif
#if defined(MEDIA_BOXES)
  // Depths of media add up, in whichever order they come.
#ifdef MEDIA_APART
  media_see();
#endif
#ifdef MEDIA_WORLD
  depth = media_depth(1u, origin, direction, 0.0, limit);
#endif
  for (int k = FIRST_BOX; k < FIRST_BOX + MEDIA_BOXES; k++) {
    vec2 met = media_box(k, origin, direction);
    float from = max(met.x, 0.0);
    float to = min(met.y, limit);
#ifdef MEDIA_APART
    to = ((media_seen >> uint(k) & 1u) != 0u) ? to : from;
#endif
    if (to > from) {
      depth += media_depth(1u << uint(k), origin, direction, from, to);
    }
  }
#elif defined(MEDIA_BOUNDED)
  uint inside = media_at_start();
  float from = 0.0;
  for (int i = 0; i < media_intervals() && from < limit; i++) {
    float to = media_until(i, limit);
    depth += media_depth(inside, origin, direction, from, to);
    inside = media_behind(i, inside);
    from = to;
  }
#elif defined(MEDIA_WORLD)
  depth = media_depth(1u, origin, direction, 0.0, limit);
#endif
  return exp(-min(depth, vec3(1e30)));
}

// The same of any ray of the kind that was asked about last.
vec3 media_transmittance_asked(vec3 origin, vec3 direction, float limit, uint salt)
{
#if defined(MEDIA_BOUNDED) && !defined(MEDIA_BOXES)
  media_crossings(origin, direction);
#endif
  return media_transmittance_known(origin, direction, limit, salt);
}

// The same of any leg of light.
vec3 media_transmittance(vec3 origin, vec3 direction, float limit, uint salt)
{
  media_asked_by(MEDIA_OF_SHADOW);
  return media_transmittance_asked(origin, direction, limit, salt);
}
