// Depth comparisons over boxes of a map whose basis was averaged beforehand (addon/kernels/convolution.py): what convolution
// shadow maps of every projection ask. Binds the basis, by table or by pyramid, and `base_extent`, `tile_columns`,
// `basis_rows`, `top_level`.
#include "lib/convolution.glsl"

#define MOST_TAPS 4
#define LEAST_SHARE 0.02  // of a box: what the series leaves of a box without any blocker

#ifdef PREFILTER_TABLE
ivec4 basis_sum(ivec2 place)
{
  return (min(place.x, place.y) <= 0) ? ivec4(0) : ivec4(basis_table_fetch(place - 1));
}
#else
vec4 basis_level(ivec2 origin, vec2 low, vec2 high, vec2 place, int level)
{
  float size = float(1 << level);
  vec2 p = clamp(place / size - 0.5, low / size, max(high / size - 1.0, low / size));
  ivec2 corner = ivec2(floor(p));
  vec2 t = p - vec2(corner);
  ivec2 most = max(ivec2(high / size) - 1, ivec2(low / size));
  ivec2 offset = (origin >> level) + ivec2(0, basis_rows - (basis_rows >> (level - 1)));
  ivec2 next = min(corner + 1, most);
  vec4 a = basis_means_fetch(offset + corner);
  vec4 b = basis_means_fetch(offset + ivec2(next.x, corner.y));
  vec4 c = basis_means_fetch(offset + ivec2(corner.x, next.y));
  vec4 d = basis_means_fetch(offset + next);
  return mix(mix(a, b, t.x), mix(c, d, t.x), t.y);
}
#endif

// Mean of a tile of the basis over the box a..b, texels from the corner of `rectangle` (origin, size) in the map.
vec4 basis_mean(vec4 rectangle, vec2 a, vec2 b, int tile)
{
  ivec2 origin = ivec2(tile % tile_columns, tile / tile_columns) * base_extent;
#ifdef PREFILTER_TABLE
  origin += ivec2(rectangle.xy);
  ivec2 low = ivec2(floor(a + 0.5));
  ivec2 high = max(ivec2(floor(b + 0.5)), low + 1);
  high = min(high, ivec2(rectangle.z));
  low = min(low, high - 1);
  ivec4 sum = basis_sum(origin + high) - basis_sum(origin + ivec2(low.x, high.y)) -
              basis_sum(origin + ivec2(high.x, low.y)) + basis_sum(origin + low);
  return vec4(sum) / (32767.0 * float((high.x - low.x) * (high.y - low.y)));
#else
  // Long boxes are read in up to MOST_TAPS parts. Read bilinearly, texels of side s weigh like a box of side sqrt(3) s:
  // their variances are s^2 / 4 and w^2 / 12.
  vec2 size = b - a;
  float longest = max(size.x, size.y);
  int taps = int(clamp(ceil(longest / max(min(size.x, size.y), 1.0) - 0.5), 1.0, float(MOST_TAPS)));
  float side = max(longest / float(taps), min(size.x, size.y));
  vec2 tap = (size.x > size.y) ? vec2(size.x / float(taps), 0.0) : vec2(0.0, size.y / float(taps));
  float level = clamp(log2(0.57735 * side), 1.0, float(top_level));
  int lower = int(level);
  vec2 corner = rectangle.xy;
  vec4 sum = vec4(0.0);
  for (int k = 0; k < taps; k++) {
    vec2 place = corner + 0.5 * (a + b) + (float(k) - 0.5 * float(taps - 1)) * tap;
    vec4 mean = basis_level(origin, corner, corner + rectangle.z, place, lower);
    if (level > float(lower)) {
      mean = mix(mean, basis_level(origin, corner, corner + rectangle.z, place, lower + 1), level - float(lower));
    }
    sum += mean;
  }
  return sum / float(taps);
#endif
}

// Sum over four terms of the series.
float basis_sum_terms(vec4 weight, float d, vec4 frequency, vec4 sines, vec4 cosines)
{
  return dot(weight, sin(frequency * d) * cosines - cos(frequency * d) * sines);
}

// Share of the box that is nearer than the depth d.
float basis_nearer(vec4 rectangle, vec2 a, vec2 b, float d)
{
  float share = 0.5;
  for (int group = 0; group < ORDER / 4; group++) {
    vec4 frequency = basis_frequencies(group);
    vec4 sines = basis_mean(rectangle, a, b, 4 * group);
    vec4 cosines = basis_mean(rectangle, a, b, 4 * group + 1);
    share += basis_sum_terms(2.0 / frequency, d, frequency, sines, cosines);
  }
  return clamp(share * SERIES_SCALE + 0.5 * (1.0 - SERIES_SCALE), 0.0, 1.0);
}

// The same share, with tapered terms that do not ring, and the mean depth of what is nearer, times the share.
vec2 basis_blockers(vec4 rectangle, vec2 a, vec2 b, float d)
{
  vec2 found = 0.5 * vec2(1.0, basis_mean(rectangle, a, b, ORDER).x);
  for (int group = 0; group < ORDER / 4; group++) {
    vec4 frequency = basis_frequencies(group);
    vec4 angle = frequency / float(2 * ORDER);
    vec4 weight = 2.0 / frequency * sin(angle) / angle;  // Lanczos' factors
    vec4 sines = basis_mean(rectangle, a, b, 4 * group);
    vec4 cosines = basis_mean(rectangle, a, b, 4 * group + 1);
    vec4 depth_sines = basis_mean(rectangle, a, b, 4 * group + 2);
    vec4 depth_cosines = basis_mean(rectangle, a, b, 4 * group + 3);
    found += vec2(basis_sum_terms(weight, d, frequency, sines, cosines),
                  basis_sum_terms(weight, d, frequency, depth_sines, depth_cosines));
  }
  return found;
}
