// Probes: points of the picture's surfaces from whose view points are found that light it. They stand in cells of space:
// of those that the picture shows as many as there are probes are drawn by their numbers alone, and of each the pixel that
// shows what is nearest to a point in it. So pictures of cameras side by side have the same probes but at their edges.
//
// Those that show glass stand for what is straight behind it, and those that show metal for what is mirrored there: a
// virtual light sends to all sides what its probe saw of it, and of two mirrors one sees highlights of lamps in the other
// that nothing else sees. One in MOVED stands where a ray from it meets the next surface: there pixels look for light by
// rays, and of a picture that shows one wall alone nothing else would find what that wall sends to the next.
#include "indirect/path.glsl"
#include "indirect/probe_cell.glsl"

#define MOST_MIRRORS 4  // one behind another, that a probe looks at
#define MOVED 16u
#define WIDE_LOBE 0.55  // roughness from which a lobe sends its light about as far around as a virtual light does

struct Probe {
  bool receives;
  vec3 position;
  vec3 normal;
  vec3 geometric_normal;
};

// Whether what a surface mirrors is most of what it sends on.
bool is_metal(vec3 diffuse, vec3 straight)
{
  return luminance(straight) > luminance(diffuse);
}

// The pixel of a cell, whose entries in the sorted list begin at `entry`, who the cell is, and the point in it to which the
// pixel is nearest.
ivec2 pixel_of_cell(int entry, out uint id, out vec3 middle)
{
  ivec2 at = ivec2(entry % LIST_COLUMNS, entry / LIST_COLUMNS);
  uint key = sorted_keys_fetch(at).x;
  ivec2 best = lattice_pixel(int(sorted_order_fetch(at).x));
  Cell cell = cell_of(surface_position_fetch(best).xyz);
  uvec3 bits = cell_bits(cell);
  id = bits.z;
  vec3 within = vec3(scrambled(film_view.bits_z, bits.x), scrambled(film_view.bits_w, bits.y),
                     to_unit(hash3(bits + uint(film_view.sample_index)).x));
  middle = (vec3(cell.place) - CELL_OFFSET + within) * cell.side;
  float nearest = 1e30;
  for (int i = entry; i < lattice.x * lattice.y; i++) {
    at = ivec2(i % LIST_COLUMNS, i / LIST_COLUMNS);
    if (sorted_keys_fetch(at).x != key) {
      break;
    }
    ivec2 pixel = lattice_pixel(int(sorted_order_fetch(at).x));
    vec3 path = surface_position_fetch(pixel).xyz - middle;
    float squared = dot(path, path);
    best = (squared < nearest) ? pixel : best;
    nearest = min(squared, nearest);
  }
  // Between pixels of the grid, by steps that are halved: with the grid alone the probe would move where it does.
  ivec2 size = surface_position_size();
  for (int stride = max((size.x + lattice.x - 1) / lattice.x, 1); stride > 0; stride /= 2) {
    ivec2 middle_pixel = best;
    for (int k = 0; k < 9; k++) {
      ivec2 pixel = clamp(middle_pixel + stride * (ivec2(k % 3, k / 3) - 1), ivec2(0), size - 1);
      vec4 there = surface_position_fetch(pixel);
      Cell other = cell_of(there.xyz);
      vec3 path = there.xyz - middle;
      float squared = dot(path, path);
      if (there.w != 0.0 && other.place == cell.place && other.side == cell.side && squared < nearest) {
        best = pixel;
        nearest = squared;
      }
    }
  }
  return best;
}

// The entry of the sorted list at which cell number `index` begins; -1 if there are fewer.
int begin_of_cell(int index)
{
  int low = 0;
  int high = lattice.x * lattice.y;  // the last entry with no more than `index` cells before it
  while (low < high) {
    int middle = (low + high) / 2;
    ivec2 next = ivec2((middle + 1) % LIST_COLUMNS, (middle + 1) / LIST_COLUMNS);
    bool passed = cells_before_fetch(next).x <= float(index);
    low = passed ? middle + 1 : low;
    high = passed ? high : middle;
  }
  return (low < lattice.x * lattice.y) ? low : -1;
}

void main()
{
  out_place = vec4(0.0);
  out_normals = vec4(0.0);
  int entry = begin_of_cell(int(gl_FragCoord.x));
  if (entry < 0) {
    return;
  }
  uint id;
  vec3 middle;
  ivec2 pixel = pixel_of_cell(entry, id, middle);
  Surface s = SURFACE_READ(pixel);
  Probe probe;
  probe.receives = s.hit && (max_component(s.diffuse) > 0.0 || max_component(s.glossy_weight) > 0.0);
  probe.position = s.position;
  // What is straight below that point stays where it is, while pixels do not.
  vec3 below = middle - dot(middle - s.position, s.geometric_normal) * s.geometric_normal;
  vec3 across = surface_position_fetch(min(pixel + ivec2(1), surface_position_size() - 1)).xyz - s.position;
  if (distance(below, s.position) < length(across) && length(across) < 0.5 * cell_of(s.position).side) {
    probe.position = below;
  }
  probe.normal = s.normal;
  probe.geometric_normal = s.geometric_normal;
  bool glass = s.kind == LOBE_REFRACTION;
  if (probe.receives && (glass || (s.kind <= FRESNEL_F82 && s.glossy_roughness < WIDE_LOBE && is_metal(s.diffuse, s.glossy_weight * s.glossy_tint)))) {
    vec3 onward = -TO_VIEWER(s);
    uint salt = id + uint(film_view.sample_index);
    vec3 beside = s.geometric_normal;
    if (glass) {
      beside *= (dot(onward, s.geometric_normal) < 0.0) ? -1.0 : 1.0;
    }
    else {
#ifdef HAS_SURFACE_EDIT
      s.edit = vec4(0.0);  // what an edit bends is seen here alone
#endif
      uvec3 roll = hash3(uvec3(id, salt, uint(film_view.seed)));
      vec3 ignored;
      onward = lobe_sample(lobe_begin(s, -onward), vec2(to_unit(roll.x), to_unit(roll.y)), ignored);
      probe.receives = may_mirror(s, onward);
      beside = side_of_ray(s, onward);
    }
    for (int step = 0; step < MOST_MIRRORS && probe.receives; step++) {
      ivec2 hit;
      vec3 origin = ray_origin(probe.position, beside);
      float t = trace_nearest(origin, onward, 1e29, salt, hit);
      probe.receives = t < 1e29;
      if (!probe.receives) {
        break;
      }
      probe.position = origin + t * onward;
      probe.normal = triangle_normal(hit);
      probe.normal *= (dot(probe.normal, onward) > 0.0) ? -1.0 : 1.0;
      probe.geometric_normal = beside = probe.normal;
      Reflection met = mean_reflection(hit);
      if (glass || !is_metal(met.diffuse, met.straight)) {
        break;
      }
      onward = reflect(onward, probe.normal);
      probe.receives = step + 1 < MOST_MIRRORS;
    }
  }
  else if (probe.receives && id % MOVED == 0u) {
    uvec3 roll = hash3(uvec3(id, uint(film_view.sample_index), uint(film_view.seed) + 5u));
    vec3 onward = cosine_direction(probe.normal, vec2(to_unit(roll.x), to_unit(roll.y)));
    vec3 origin = ray_origin(probe.position, probe.geometric_normal);
    ivec2 hit;
    float t = (dot(onward, probe.geometric_normal) > 0.0) ? trace_nearest(origin, onward, 1e29, roll.z, hit) : 1e29;
    if (t < 1e29) {
      probe.position = origin + t * onward;
      probe.normal = triangle_normal(hit);
      probe.normal *= (dot(probe.normal, onward) > 0.0) ? -1.0 : 1.0;
      probe.geometric_normal = probe.normal;
    }
  }
  if (probe.receives) {
    out_place = vec4(probe.position, float(1u + (id >> 9u)));
    out_normals = vec4(octahedral_encode(probe.normal), octahedral_encode(probe.geometric_normal));
  }
}
