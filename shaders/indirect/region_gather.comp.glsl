// Irradiance by virtual lights at regions, into the atlas: at those of the list, or (BY_LEVEL) at those of one level that
// gather.
#include "indirect/path.glsl"
#include "indirect/regions.glsl"
#include "generated/gather"

void gather(ivec2 region, int level_of_region)
{
  ivec2 pixel = region_pixel(region, level_of_region);
  vec4 irradiance = vec4(0.0);
  Surface s = SURFACE_READ(pixel);
  if (s.hit) {
    uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 31u));
    uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 7);
    vec3 origin = ray_origin(s.position, s.geometric_normal);
    float choice = scrambled(film_view.bits_w, salt.z);
    irradiance = vec4(virtual_gather(s, vec3(0.0), false, origin, choice, salt.x + roll.x), 1.0);
  }
  imageStore(gathered, region_place(region, level_of_region), irradiance);
}

#ifdef BY_LEVEL
void main()
{
  ivec2 region = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
  ivec2 first = (region << level) - grid_offset;
  if (any(lessThan(first + (1 << level), ivec2(1))) || any(greaterThanEqual(first, surface_position_size()))) {
    return;
  }
  bool split = level > 0 && region_flags_fetch(region).x > 0.5;
  if (!split && (level == levels || coarser_flags_fetch(region >> 1).x > 0.5)) {
    gather(region, level);
  }
}
#else
void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
  if (place.y >= surface_position_size().y) {
    return;
  }
  // Fewer threads than there is room for: the list is mostly short, and a thread without an entry is not free.
  int count = int(entry_count_fetch(ivec2(0)).x);
  uint axis = (1u << REGION_BITS) - 1u;
  for (; entry_index(place) < count; place.x += columns) {
    uint entry = entries_fetch(place).x;
    gather(ivec2(entry & axis, (entry >> REGION_BITS) & axis), int(entry >> (2 * REGION_BITS)));
  }
}
#endif
