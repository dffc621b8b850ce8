// Voronoi Texture: distances to feature points, one per cell of a grid.
// Worley, "A Cellular Texture Basis Function", 1996; smooth minimum and exact distance to the edges after Inigo
// Quilez, "Smooth Voronoi" (2014) and "Voronoi Borders" (2012).
// Up to Blender 4.5 cells are hashed by lookup3, from 5.0 on by PCG (`pcg`), but in one dimension.
// `dimensions`, `pcg`, `feature` and `metric` are literals, so a compiler keeps the one path that is meant. Unused
// coordinates are 0 and their cells are not visited; in one dimension the coordinate stands in x.

#include "material/hash.glsl"

#define VORONOI_F1 0
#define VORONOI_F2 1
#define VORONOI_SMOOTH_F1 2

#define METRIC_EUCLIDEAN 0
#define METRIC_MANHATTAN 1
#define METRIC_CHEBYCHEV 2
#define METRIC_MINKOWSKI 3

struct VoronoiCell {
  float distance;
  vec3 color;
  vec4 position;
};

// Which offsets each axis visits: none along an axis that the texture does not have.
ivec4 voronoi_reach(int dimensions, int radius)
{
  return radius * ivec4(1, int(dimensions > 1), int(dimensions > 2), int(dimensions > 3));
}

// Where in its cell the feature point stands, 0..1.
vec4 voronoi_point(ivec4 cell, int dimensions, bool pcg)
{
  vec4 k = vec4(cell);
  if (dimensions == 1) {
    return vec4(hash_float(k.x), 0.0, 0.0, 0.0);
  }
  if (dimensions == 2) {
    return vec4(pcg ? hash_cell(cell.xy) : vec2(hash_float(k.xy), hash_float(vec3(k.xy, 1.0))), 0.0, 0.0);
  }
  if (dimensions == 3) {
    return vec4(pcg ? hash_cell(cell.xyz) : hash_color(k.xyz), 0.0);
  }
  return pcg ? hash_cell(cell) : vec4(hash_float(k), hash_float(k.wxyz), hash_float(k.zwxy), hash_float(k.yzwx));
}

vec3 voronoi_color(ivec4 cell, int dimensions, bool pcg)
{
  vec4 k = vec4(cell);
  if (dimensions == 1) {
    return hash_color(k.x);
  }
  if (!pcg) {
    return (dimensions == 2) ? hash_color(k.xy) : ((dimensions == 3) ? hash_color(k.xyz) : hash_color(k));
  }
  return (dimensions < 4) ? hash_cell(cell.xyz) : hash_cell(cell).xyz;
}

float voronoi_distance(vec4 a, vec4 b, int dimensions, int metric, float exponent)
{
  vec4 d = abs(a - b);
  if (dimensions == 1 || metric == METRIC_MANHATTAN) {
    return d.x + d.y + d.z + d.w;
  }
  if (metric == METRIC_CHEBYCHEV) {
    return max(max(d.x, d.y), max(d.z, d.w));
  }
  if (metric == METRIC_MINKOWSKI) {
    vec4 powers = pow(d, vec4(exponent));
    powers *= vec4(voronoi_reach(dimensions, 1));  // 0^0 is 1, but an axis that is not there adds nothing
    return pow(powers.x + powers.y + powers.z + powers.w, 1.0 / exponent);
  }
  return length(d);
}

VoronoiCell voronoi_nearest(vec4 coordinate, int dimensions, bool pcg, bool second, int metric, float exponent,
                            float randomness)
{
  vec4 corner = floor(coordinate);
  vec4 place = coordinate - corner;
  ivec4 cell = ivec4(corner);
  ivec4 reach = voronoi_reach(dimensions, 1);
  float first_distance = 3e38;
  float second_distance = 3e38;
  ivec4 first_offset = ivec4(0);
  ivec4 second_offset = ivec4(0);
  vec4 first_position = vec4(0.0);
  vec4 second_position = vec4(0.0);
  for (int u = -reach.w; u <= reach.w; u++) {
    for (int k = -reach.z; k <= reach.z; k++) {
      for (int j = -reach.y; j <= reach.y; j++) {
        for (int i = -reach.x; i <= reach.x; i++) {
          ivec4 offset = ivec4(i, j, k, u);
          vec4 position = vec4(offset) + randomness * voronoi_point(cell + offset, dimensions, pcg);
          float distance = voronoi_distance(position, place, dimensions, metric, exponent);
          if (distance < first_distance) {
            second_distance = first_distance;
            second_offset = first_offset;
            second_position = first_position;
            first_distance = distance;
            first_offset = offset;
            first_position = position;
          }
          else if (distance < second_distance) {
            second_distance = distance;
            second_offset = offset;
            second_position = position;
          }
        }
      }
    }
  }
  VoronoiCell found;
  found.distance = second ? second_distance : first_distance;
  found.color = voronoi_color(cell + (second ? second_offset : first_offset), dimensions, pcg);
  found.position = corner + (second ? second_position : first_position);
  return found;
}

VoronoiCell voronoi_smooth(vec4 coordinate, int dimensions, bool pcg, int metric, float exponent, float randomness,
                           float smoothness)
{
  vec4 corner = floor(coordinate);
  vec4 place = coordinate - corner;
  ivec4 cell = ivec4(corner);
  ivec4 reach = voronoi_reach(dimensions, 2);
  float smooth_distance = 0.0;
  vec3 smooth_color = vec3(0.0);
  vec4 smooth_position = vec4(0.0);
  bool begun = false;
  for (int u = -reach.w; u <= reach.w; u++) {
    for (int k = -reach.z; k <= reach.z; k++) {
      for (int j = -reach.y; j <= reach.y; j++) {
        for (int i = -reach.x; i <= reach.x; i++) {
          ivec4 offset = ivec4(i, j, k, u);
          vec4 position = vec4(offset) + randomness * voronoi_point(cell + offset, dimensions, pcg);
          float distance = voronoi_distance(position, place, dimensions, metric, exponent);
          float h = begun ? smoothstep(0.0, 1.0, 0.5 + 0.5 * (smooth_distance - distance) / smoothness) : 1.0;
          begun = true;
          float correction = smoothness * h * (1.0 - h);
          smooth_distance = mix(smooth_distance, distance, h) - correction;
          correction /= 1.0 + 3.0 * smoothness;
          smooth_color = mix(smooth_color, voronoi_color(cell + offset, dimensions, pcg), h) - vec3(correction);
          smooth_position = mix(smooth_position, position, h) - vec4(correction);
        }
      }
    }
  }
  VoronoiCell found;
  found.distance = smooth_distance;
  found.color = smooth_color;
  found.position = corner + smooth_position;
  return found;
}

float voronoi_edge(vec4 coordinate, int dimensions, bool pcg, float randomness)
{
  vec4 corner = floor(coordinate);
  vec4 place = coordinate - corner;
  ivec4 cell = ivec4(corner);
  if (dimensions == 1) {
    float middle = randomness * voronoi_point(cell, 1, pcg).x;
    float left = -1.0 + randomness * voronoi_point(cell - ivec4(1, 0, 0, 0), 1, pcg).x;
    float right = 1.0 + randomness * voronoi_point(cell + ivec4(1, 0, 0, 0), 1, pcg).x;
    return min(abs(0.5 * (middle + left) - place.x), abs(0.5 * (middle + right) - place.x));
  }
  ivec4 reach = voronoi_reach(dimensions, 1);
  vec4 nearest = vec4(0.0);
  float least = 3e38;
  // Twice over the cells: the nearest point, then the least distance to the plane half way to each other one.
  for (int pass = 0; pass < 2; pass++) {
    least = 3e38;
    vec4 found = nearest;
    for (int u = -reach.w; u <= reach.w; u++) {
      for (int k = -reach.z; k <= reach.z; k++) {
        for (int j = -reach.y; j <= reach.y; j++) {
          for (int i = -reach.x; i <= reach.x; i++) {
            ivec4 offset = ivec4(i, j, k, u);
            vec4 arm = vec4(offset) + randomness * voronoi_point(cell + offset, dimensions, pcg) - place;
            vec4 apart = arm - nearest;
            float squared = dot(arm, arm);
            if (pass == 0) {
              found = (squared < least) ? arm : found;
              least = min(least, squared);
            }
            else if (dot(apart, apart) > 0.0001) {
              least = min(least, dot(0.5 * (nearest + arm), normalize(apart)));
            }
          }
        }
      }
    }
    nearest = found;
  }
  return least;
}

float voronoi_radius(vec4 coordinate, int dimensions, bool pcg, float randomness)
{
  vec4 corner = floor(coordinate);
  vec4 place = coordinate - corner;
  ivec4 cell = ivec4(corner);
  ivec4 reach = voronoi_reach(dimensions, 1);
  vec4 nearest = place;
  ivec4 nearest_offset = ivec4(0);
  float least = 3e38;
  // Twice over the cells: the point nearest to the place, then the one nearest to that point.
  for (int pass = 0; pass < 2; pass++) {
    least = 3e38;
    vec4 from = nearest;
    ivec4 middle = nearest_offset;
    for (int u = -reach.w; u <= reach.w; u++) {
      for (int k = -reach.z; k <= reach.z; k++) {
        for (int j = -reach.y; j <= reach.y; j++) {
          for (int i = -reach.x; i <= reach.x; i++) {
            ivec4 offset = ivec4(i, j, k, u) + middle;
            vec4 position = vec4(offset) + randomness * voronoi_point(cell + offset, dimensions, pcg);
            float distance = length(position - from);
            if (distance < least && !(pass == 1 && offset == middle)) {
              least = distance;
              nearest = position;
              nearest_offset = offset;
            }
          }
        }
      }
    }
  }
  return 0.5 * least;
}

vec4 voronoi_coordinate(vec3 vector, float w, float scale, int dimensions)
{
  if (dimensions == 1) {
    return vec4(w * scale, 0.0, 0.0, 0.0);
  }
  vec4 p = scale * vec4(vector, w);
  return vec4(p.xy, (dimensions > 2) ? p.z : 0.0, (dimensions > 3) ? p.w : 0.0);
}

// Octaves as of fractal noise; sums of positions and distances to edges are blends instead.
void voronoi_texture(vec3 vector, float w, float scale, float detail, float roughness, float lacunarity,
                     float smoothness, float exponent, float randomness, int dimensions, bool pcg, int feature,
                     int metric, bool normalized, out float distance, out vec3 color, out vec3 position,
                     out float w_position)
{
  vec4 coordinate = voronoi_coordinate(vector, w, scale, dimensions);
  float octaves = clamp(detail, 0.0, 15.0);
  float rough = clamp(roughness, 0.0, 1.0);
  float spread = clamp(randomness, 0.0, 1.0);
  float soft = clamp(0.5 * smoothness, 0.0, 0.5);
  bool plain = octaves == 0.0 || rough == 0.0;
  float fraction = octaves - floor(octaves);
  float amplitude = 1.0;
  float amplitudes = 0.0;
  float octave_scale = 1.0;
  distance = 0.0;
  color = vec3(0.0);
  vec4 place = vec4(0.0);
  for (int i = 0; i <= int(ceil(octaves)); i++) {
    VoronoiCell octave;
    if (feature == VORONOI_SMOOTH_F1 && soft != 0.0) {
      octave = voronoi_smooth(coordinate * octave_scale, dimensions, pcg, metric, exponent, spread, soft);
    }
    else {
      octave = voronoi_nearest(coordinate * octave_scale, dimensions, pcg, feature == VORONOI_F2, metric, exponent,
                               spread);
    }
    if (plain) {
      amplitudes = 1.0;
      distance = octave.distance;
      color = octave.color;
      place = octave.position;
      break;
    }
    float share = (float(i) <= octaves) ? 1.0 : fraction;
    amplitudes += share * amplitude;
    distance += share * amplitude * octave.distance;
    color += share * amplitude * octave.color;
    place = mix(place, mix(place, octave.position / octave_scale, amplitude), share);
    octave_scale *= lacunarity;
    amplitude *= rough;
  }
  if (normalized) {
    vec4 farthest = (0.5 + 0.5 * spread) * vec4(voronoi_reach(dimensions, 1));
    float reach = voronoi_distance(vec4(0.0), farthest, dimensions, metric, exponent);
    distance /= amplitudes * ((feature == VORONOI_F2) ? 2.0 : 1.0) * reach;
    color /= amplitudes;
  }
  place = (scale != 0.0) ? place / scale : vec4(0.0);
  position = (dimensions == 1) ? vec3(0.0) : place.xyz;
  w_position = (dimensions == 1) ? place.x : place.w;
}

void voronoi_edge_texture(vec3 vector, float w, float scale, float detail, float roughness, float lacunarity,
                          float randomness, int dimensions, bool pcg, bool normalized, out float distance)
{
  vec4 coordinate = voronoi_coordinate(vector, w, scale, dimensions);
  float octaves = clamp(detail, 0.0, 15.0);
  float rough = clamp(roughness, 0.0, 1.0);
  float spread = clamp(randomness, 0.0, 1.0);
  float fraction = octaves - floor(octaves);
  float farthest = 0.5 + 0.5 * spread;
  float amplitude = 1.0;
  float reach = farthest;
  float octave_scale = 1.0;
  distance = 8.0;
  for (int i = 0; i <= int(ceil(octaves)); i++) {
    float octave = voronoi_edge(coordinate * octave_scale, dimensions, pcg, spread);
    if (octaves == 0.0 || rough == 0.0) {
      distance = octave;
      break;
    }
    float share = (float(i) <= octaves) ? 1.0 : fraction;
    reach = mix(reach, mix(reach, farthest / octave_scale, amplitude), share);
    float nearer = mix(distance, min(distance, octave / octave_scale), amplitude);
    distance = mix(distance, min(distance, nearer), share);
    octave_scale *= lacunarity;
    amplitude *= rough;
  }
  distance = normalized ? distance / reach : distance;
}

void voronoi_radius_texture(vec3 vector, float w, float scale, float randomness, int dimensions, bool pcg,
                            out float radius)
{
  vec4 coordinate = voronoi_coordinate(vector, w, scale, dimensions);
  radius = voronoi_radius(coordinate, dimensions, pcg, clamp(randomness, 0.0, 1.0));
}
