// Guiding: does light from a cell of directions (column) arrive at a probe (row), a pixel of a coarse grid? By its cosine;
// y: if nothing were in the way.
// Each probe shifts its directions within the cells, so that the mean over the probes covers them.
#include "lib/gbuffer.glsl"
#include "trace/rays.glsl"

void main()
{
  out_useful = vec2(0.0);
  ivec2 place = ivec2(gl_FragCoord.xy);
  ivec2 probe = ivec2(place.y % probes.x, place.y / probes.x);
  uvec3 bits = hash3(uvec3(uint(place.x), uint(place.y), 41u));
  vec2 shift = vec2(to_unit(bits.x), to_unit(bits.y));
  vec2 size = vec2(surface_position_size());
  uvec3 pixel_bits = hash3(uvec3(uint(place.y), 7u, 5u));
  vec2 within = vec2(to_unit(pixel_bits.x), to_unit(pixel_bits.y));
  ivec2 pixel = ivec2((vec2(probe) + within) / vec2(probes) * size);
  Surface s = SURFACE_READ(pixel);
  if (!s.hit) {
    return;
  }
  vec2 cell = vec2(float(place.x % columns), float(place.x / columns)) + shift;
  float z = 2.0 * cell.y / float(rows) - 1.0;
  float azimuth = (cell.x / float(columns) - 0.5) * 2.0 * PI;
  float ring = sqrt(max(1.0 - z * z, 0.0));
  vec3 direction = vec3(ring * cos(azimuth), ring * sin(azimuth), z);
  bool translucent = s.kind == LOBE_TRANSLUCENT && max_component(s.glossy_weight) > 0.0;
  bool fibre = s.kind == LOBE_TOON && s.glossy_tint.z < 0.9;  // lib/hair.glsl: lit from all sides alike
  float cosine = translucent ? abs(dot(direction, s.normal)) : (fibre ? 0.5 : dot(direction, s.normal));
  if (cosine <= 0.0) {
    return;
  }
  float side = (dot(direction, s.geometric_normal) < 0.0 && translucent) ? -1.0 : 1.0;
  out_useful.y = cosine;
  if (fibre && dot(direction, s.geometric_normal) < 0.0) {
    out_useful.x = cosine;  // a ray would have to begin beyond the fibre
    return;
  }
  out_useful.x = cosine * clear_path(ray_origin(s.position, side * s.geometric_normal), direction, 1e29, bits.z);
}
