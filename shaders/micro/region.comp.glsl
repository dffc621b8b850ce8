// Irradiance at regions of the picture (indirect/regions.glsl) by a micro-buffer each: at those of the list, or (BY_LEVEL)
// at those of one level that gather.
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "indirect/regions.glsl"
#include "micro/buffer.glsl"
#define MICRO_WORD(texel) (imageLoad(micro, texel).x)
#include "micro/sum.glsl"

void gather(ivec2 region, int level_of_region, ivec2 corner)
{
  ivec2 pixel = region_pixel(region, level_of_region);
  ivec2 own_place = region_place(region, level_of_region);
  Surface s = SURFACE_READ(pixel);
  if (!s.hit) {
    imageStore(gathered, own_place, vec4(0.0));
    return;
  }
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 31u));
  vec3 own = fract(buffer_choice.yzw + vec3(to_unit(salt.x), to_unit(salt.y), to_unit(salt.z)));
  MicroFrame f = micro_frame(s.position, s.normal, s.geometric_normal, own);
  if (part.x == 0) {
    micro_clear(corner);
  }
  micro_fill(f, corner);
  if (part.x == part.y - 1) {
    vec3 irradiance = micro_sum(corner, f.place).rgb;
#ifdef NODE_LOBES
    irradiance += micro_lobes(corner, f);
#endif
    imageStore(gathered, own_place, vec4(irradiance, 1.0));
  }
}

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  if (place.x >= columns || place.y >= row_count) {
    return;
  }
  ivec2 corner = place * micro_side;
#ifdef BY_LEVEL
  place += ivec2(first_column, first_row);
  ivec2 first = (place << region_level) - grid_offset;
  bool outside = any(lessThan(first + (1 << region_level), ivec2(1))) || any(greaterThanEqual(first, surface_position_size()));
  bool split = region_level > 0 && region_flags_fetch(place).x > 0.5;
  if (!outside && !split && (region_level == levels || coarser_flags_fetch(place >> 1).x > 0.5)) {
    gather(place, region_level, corner);
  }
#else
  int index = (first_row + place.y) * list_width + first_column + place.x;
  if (index < int(entry_count_fetch(ivec2(0)).x)) {
    uint entry = entries_fetch(entry_place(index)).x;
    uint axis = (1u << REGION_BITS) - 1u;
    gather(ivec2(entry & axis, (entry >> REGION_BITS) & axis), int(entry >> (2 * REGION_BITS)), corner);
  }
#endif
}
