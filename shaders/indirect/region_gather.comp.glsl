// Irradiance by virtual lights at the regions of the list (EVERY_PIXEL: at each pixel), into the atlas.
#include "indirect/path.glsl"
#include "indirect/regions.glsl"
#include "generated/gather"

void gather(ivec2 region, int level)
{
  ivec2 pixel = region_pixel(region, level);
  vec4 irradiance = vec4(0.0);
  Surface s = SURFACE_READ(pixel);
  if (s.hit) {
    uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 31u));
    uvec3 roll = hash3(uvec3(uvec2(pixel), uint(film_view.sample_index * 1024 + 7)));
    vec3 origin = ray_origin(s.position, s.geometric_normal);
    float choice = scrambled(film_view.bits_w, salt.z);
    irradiance = vec4(virtual_gather(s, vec3(0.0), false, origin, choice, salt.x + roll.x), 1.0);
  }
  imageStore(gathered, region_place(region, level), irradiance);
}

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
  ivec2 size = textureSize(surface_position, 0);
  if (place.y >= size.y) {
    return;
  }
#ifdef EVERY_PIXEL
  if (place.x < size.x) {
    gather(place + grid_offset, 0);
  }
#else
  // Fewer threads than there is room for: the list is mostly short, and a thread without an entry is not free.
  int count = int(imageLoad(entry_count, ivec2(0)).x);
  uint axis = (1u << REGION_BITS) - 1u;
  for (; entry_index(place) < count; place.x += columns) {
    uint entry = imageLoad(entries, place).x;
    gather(ivec2(entry & axis, (entry >> REGION_BITS) & axis), int(entry >> (2 * REGION_BITS)));
  }
#endif
}
