// A ray through media as a row of bins, in each of which extinction is taken as even: what is left of light where a bin
// begins, and a density of places to scatter at, in proportion to what a place would send back if it were lit evenly.
// Leaves out links: in media and through glass light reaches every receiver.
#include "media/media.glsl"
#include "media/phase.glsl"

#define GRID_BINS 12  // at most, of one interval between boundaries
#if !defined(MEDIA_BOUNDED) || (defined(MEDIA_BOXES) && MEDIA_BOXES == 1 && !defined(MEDIA_WORLD))
#define MOST_INTERVALS 1  // in media
#elif defined(MEDIA_BOXES)
#define MOST_INTERVALS (2 * MEDIA_BOXES + 1)
#else
#define MOST_INTERVALS 24
#endif
#if !defined(MEDIA_GRIDS)
#define MOST_BINS MOST_INTERVALS
#elif MOST_INTERVALS == 1
#define MOST_BINS GRID_BINS
#else
#define MOST_BINS 24
#endif

struct Bins {
  int count;
  float from[MOST_BINS];
  float to[MOST_BINS];
  uint media[MOST_BINS];
  vec3 extinction[MOST_BINS];
  vec3 left[MOST_BINS];   // transmittance up to where the bin begins
  float weight[MOST_BINS];  // cumulative
  vec3 end;               // transmittance of the whole ray
  float total;            // of the weights
  vec3 emitted;           // radiance that media before the end send to the start
};

// Of a grid, scattering is known at one cell that was drawn, extinction as a mean along the bin.
#ifdef MEDIA_GRIDS
#define LEAST_ALBEDO 0.3
#define EVEN_SHARE 0.1  // of the weights, given to all bins alike: cells that were not drawn may scatter, too
#else
#define LEAST_ALBEDO 1e-3
#endif

// The ray that was asked for last. Not a parameter: compilers copy arrays for each call, and take long over it.
Bins bins;

#ifdef MEDIA_GRIDS
bool any_grid(uint inside)
{
  bool found = false;
  while (inside != 0u) {
    found = found || medium_texel(findLSB(inside), 0).w > 0.5;
    inside &= inside - 1u;
  }
  return found;
}

float smallest_cell(uint inside)
{
  float size = 1e30;
  while (inside != 0u) {
    int medium = findLSB(inside);
    inside &= inside - 1u;
    if (medium_texel(medium, 0).w > 0.5) {
      size = min(size, medium_cell_size(medium));
    }
  }
  return size;
}
#endif

// Scattering, and emission, of all media at a place: sums.
void media_at(uint inside, vec3 position, inout uint seed, out vec3 scattering, out vec3 emission)
{
  scattering = vec3(0.0);
  emission = vec3(0.0);
  while (inside != 0u) {
    int medium = findLSB(inside);
    inside &= inside - 1u;
    Medium m = medium_read(medium);
#ifdef MEDIA_GRIDS
    if (m.grid > 0.5) {
      ivec2 cell = medium_cell(medium, position, seed);
      ivec2 first = medium_first_row(medium);
      scattering += media_scattering_fetch(cell - first).rgb;
      emission += media_emission_fetch(cell - first).rgb;
      continue;
    }
#endif
    scattering += m.scattering;
    emission += m.emission;
  }
}

// A medium with what it scatters at a place.
Medium medium_scattering_at(int medium, vec3 position, uint cell_seed)
{
  Medium m = medium_read(medium);
#ifdef MEDIA_GRIDS
  if (m.grid > 0.5) {
    uint seed = cell_seed + uint(medium);
    ivec2 cell = medium_cell(medium, position, seed);
    m.scattering = media_scattering_fetch(cell - medium_first_row(medium)).rgb;
    m.anisotropy = media_table_fetch(cell).w;
  }
#endif
  return m;
}

// Scattering coefficient times phase function, for light that goes on along `out_direction` after `in_direction`.
vec3 media_scattered(uint inside, vec3 position, vec3 in_direction, vec3 out_direction, uint cell_seed)
{
  float mu = dot(in_direction, out_direction);
  vec3 sum = vec3(0.0);
  while (inside != 0u) {
    int medium = findLSB(inside);
    inside &= inside - 1u;
    Medium m = medium_scattering_at(medium, position, cell_seed);
    sum += m.scattering * phase_value(m.phase, m.anisotropy, m.phase_values, mu);
  }
  return sum;
}

// The same for each unit of the scattering coefficient.
vec3 media_scattered_by_unit(uint inside, vec3 position, vec3 in_direction, vec3 out_direction, uint cell_seed)
{
  float mu = dot(in_direction, out_direction);
  vec3 sum = vec3(0.0);
  vec3 total = vec3(0.0);
  while (inside != 0u) {
    int medium = findLSB(inside);
    inside &= inside - 1u;
    Medium m = medium_scattering_at(medium, position, cell_seed);
    vec3 amount = m.scattering + 1e-20;  // where nothing scatters, something beside it may
    sum += amount * phase_value(m.phase, m.anisotropy, m.phase_values, mu);
    total += amount;
  }
  return sum / max(total, vec3(1e-30));
}

// Anisotropy of the lobe by which a direction is drawn at a place: the mean over what scatters there.
float media_lobe(uint inside, vec3 position, uint cell_seed)
{
  float sum = 0.0;
  float total = 1e-30;
  while (inside != 0u) {
    int medium = findLSB(inside);
    inside &= inside - 1u;
    Medium m = medium_scattering_at(medium, position, cell_seed);
    float weight = dot(m.scattering, vec3(1.0));
    sum += weight * phase_lobe(m.phase, m.anisotropy, m.phase_values);
    total += weight;
  }
  return clamp(sum / total, -0.95, 0.95);
}

void bins_add(uint inside, vec3 origin, vec3 direction, float from, float to, inout uint seed)
{
  if (inside == 0u || !(to > from) || bins.count >= MOST_BINS) {
    return;
  }
  vec3 extinction;
#ifdef MEDIA_GRIDS
  float middle = from + (to - from) * media_random(seed);
  extinction = media_depth(inside, origin, direction, from, to) / (to - from);
#else
  float middle = from;
  extinction = media_depth(inside, origin, direction, 0.0, 1.0);
#endif
  vec3 scattering;
  vec3 emission;
  media_at(inside, origin + middle * direction, seed, scattering, emission);
  float length_ = to - from;
  vec3 depth = min(extinction * length_, vec3(1e30));
  vec3 passing = exp(-depth);
  // The integral of exp(-extinction t) over the bin.
  vec3 reach = mix(vec3(length_), (vec3(1.0) - passing) / max(extinction, vec3(1e-30)), greaterThan(depth, vec3(1e-4)));
  bins.emitted += bins.end * emission * reach;
  int k = bins.count;
  bins.from[k] = from;
  bins.to[k] = to;
  bins.media[k] = inside;
  bins.extinction[k] = extinction;
  bins.left[k] = bins.end;
  vec3 sent = bins.end * reach * max(scattering, vec3(LEAST_ALBEDO) * extinction);
  float weight = dot(sent, vec3(1.0 / 3.0));
  bins.total += (is_finite(weight) && max_component(scattering + extinction) > 0.0) ? max(weight, 0.0) : 0.0;
  bins.weight[k] = bins.total;
  bins.end *= passing;
  bins.count = k + 1;
}

// `left`: intervals in media from here on, each of which gets its share of the bins that there are.
void bins_interval(uint inside, vec3 origin, vec3 direction, float from, float to, int left,
                   inout uint seed)
{
#ifdef MEDIA_GRIDS
  float parts = 1.0;
  if (inside != 0u && to > from && any_grid(inside)) {
    int most = clamp((MOST_BINS - bins.count) / max(left, 1), 1, GRID_BINS);
    parts = clamp(ceil((to - from) / (2.0 * smallest_cell(inside))), 1.0, float(most));
  }
  float part = (to - from) / parts;
  for (int i = 0; i < int(parts); i++) {
    float begin = from + float(i) * part;
    bins_add(inside, origin, direction, begin, (i + 1 < int(parts)) ? begin + part : to, seed);
  }
#else
  bins_add(inside, origin, direction, from, to, seed);
#endif
}

void media_bins(vec3 origin, vec3 direction, float limit, inout uint seed)
{
  bins.count = 0;
  bins.total = 0.0;
  bins.end = vec3(1.0);
  bins.emitted = vec3(0.0);
  media_crossings(origin, direction);
  uint start = media_at_start();
  int left = 0;
#ifdef MEDIA_GRIDS
  media_turn_by(seed);
  uint around = start;
  float before = 0.0;
  for (int i = 0; i < media_intervals() && before < limit; i++) {
    float to = media_until(i, limit);
    left += (around != 0u && to > before) ? 1 : 0;
    around = media_behind(i, around);
    before = to;
  }
#endif
  uint inside = start;
  float from = 0.0;
  for (int i = 0; i < media_intervals() && from < limit; i++) {
    float to = media_until(i, limit);
    bins_interval(inside, origin, direction, from, to, left, seed);
    left -= (inside != 0u && to > from) ? 1 : 0;
    inside = media_behind(i, inside);
    from = to;
  }
#ifdef MEDIA_GRIDS
  float each = EVEN_SHARE * bins.total / float(max(bins.count, 1));
  for (int i = 0; i < bins.count; i++) {
    bins.weight[i] += each * float(i + 1);
  }
  bins.total += each * float(bins.count);
#endif
}

int bins_find(float t)
{
  for (int i = 0; i < bins.count; i++) {
    if (t >= bins.from[i] && t <= bins.to[i]) {
      return i;
    }
  }
  return -1;
}

vec3 bin_passing(int k, float t)
{
  return bins.left[k] * exp(-min(bins.extinction[k] * (t - bins.from[k]), vec3(1e30)));
}

float bin_mean_extinction(int k)
{
  return dot(bins.extinction[k], vec3(1.0 / 3.0));
}

// Distance at which this optical depth is reached, or the end of the bins.
float bins_deep(float depth)
{
  for (int i = 0; i < bins.count; i++) {
    float extinction = bin_mean_extinction(i);
    if (depth < extinction * (bins.to[i] - bins.from[i])) {
      return bins.from[i] + depth / extinction;
    }
    depth -= extinction * (bins.to[i] - bins.from[i]);
  }
  return bins.to[bins.count - 1];
}

// Density per metre with which bins_draw finds a place in bin k.
float bins_density(int k, float t)
{
  float before = (k > 0) ? bins.weight[k - 1] : 0.0;
  float share = (bins.weight[k] - before) / max(bins.total, 1e-37);
  float length_ = bins.to[k] - bins.from[k];
  float extinction = bin_mean_extinction(k);
  float depth = extinction * length_;
  if (depth < 1e-4) {
    return share / length_;
  }
  return share * extinction * exp(-min(extinction * (t - bins.from[k]), 80.0)) / (1.0 - exp(-min(depth, 80.0)));
}

// A place in proportion to the weights of the bins; `k`: its bin.
float bins_draw(float u, out int k)
{
  float aim = u * bins.total;
  k = 0;
  for (int i = 0; i < bins.count - 1; i++) {
    k += (aim >= bins.weight[i]) ? 1 : 0;
  }
  float before = (k > 0) ? bins.weight[k - 1] : 0.0;
  float rest = clamp((aim - before) / max(bins.weight[k] - before, 1e-37), 0.0, 0.999999);
  float length_ = bins.to[k] - bins.from[k];
  float extinction = bin_mean_extinction(k);
  float depth = extinction * length_;
  float along = (depth < 1e-4) ? rest * length_
                               : -log(max(1.0 - rest * (1.0 - exp(-min(depth, 80.0))), 1e-37)) / extinction;
  return bins.from[k] + clamp(along, 0.0, length_);
}
