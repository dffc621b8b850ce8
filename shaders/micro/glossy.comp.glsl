// What pixels reflect of other surfaces by microfacets: a micro-buffer each, of rays of the lobe, block by block.
#define GLOSSY
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "lib/random.glsl"
#include "micro/buffer.glsl"
#define MICRO_WORD(texel) (imageLoad(micro, texel).x)
#include "micro/sum.glsl"

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  ivec2 pixel = place + ivec2(first_column, first_row);
  if (place.x >= columns || place.y >= row_count || surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  if (s.kind > FRESNEL_F82 || max_component(s.glossy_weight) <= 0.0) {
    return;
  }
  vec3 to_viewer = TO_VIEWER(s);
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 37u));
  vec3 own = fract(buffer_choice.yzw + vec3(to_unit(salt.x), to_unit(salt.y), to_unit(salt.z)));
  MicroFrame f = micro_frame(s.position, s.geometric_normal, s.geometric_normal, own);
  f.lobe = lobe_begin(s, to_viewer);
  int count = micro_side * micro_side;
  f.axis = vec3(0.0);
  vec3 weight;
  for (int i = 0; i < count; i++) {
    f.axis += micro_ray(f, ivec2(i % micro_side, i / micro_side), weight);
  }
  f.axis = safe_normalize(f.axis);
  float least = 1.0;
  for (int i = 0; i < count; i++) {
    least = min(least, dot(f.axis, micro_ray(f, ivec2(i % micro_side, i / micro_side), weight)));
  }
  f.angle = acos(clamp(least, -1.0, 1.0)) + 1e-3;
  ivec2 corner = place * micro_side;
  if (part.x == 0) {
    micro_clear(corner);
  }
  micro_fill(f, corner);
  if (part.x < part.y - 1) {
    return;
  }
  vec3 sum = vec3(0.0);
  for (int i = 0; i < count; i++) {
    ivec2 of_buffer = ivec2(i % micro_side, i / micro_side);
    uint word = imageLoad(micro, corner + of_buffer).x;
    vec3 ray = micro_ray(f, of_buffer, weight);
    if (word != NOTHING && max_component(weight) > 0.0 && may_mirror(s, ray)) {
      uint index = word & ((1u << uint(id_bits)) - 1u);
      vec3 radiance = radiance_texel(index).rgb;
#ifdef NODE_LOBES
      radiance += lobe_radiance(index, -ray, 0.0);
#endif
      sum += weight * radiance * MICRO_PASSING(f.place, word, i);
    }
  }
  imageStore(gathered, pixel, vec4(sum / float(count), 0.0));
}
