// Radiance that arrives from what the picture shows, as its cosine-weighted mean over the hemisphere: the diffuse albedo
// times this is reflected. What stands nearer on the screen hides what stands behind it.
#include "ssdo/fan.glsl"

vec3 fan_light(Fan fan, Surface s, vec2 u)
{
  uint taken = fan.below;
  vec3 sum = vec3(0.0);
  vec2 last = vec2(0.0, film_depth(fan.origin));
  for (int i = 0; i < step_count; i++) {
    Patch found;
    if (!fan_step(fan, i, fract(u + float(i) * vec2(0.6180339887, 0.7548776662)), last, found)) {
      continue;
    }
    uint seen = found.sectors & ~taken;
    taken |= seen;
    if (seen != 0u && found.faces) {
      vec3 direction = safe_normalize(found.position - fan.origin);
      vec3 radiance = texelFetch(senders, found.texel, 0).rgb;
      sum += radiance * diffuse_weight(s, fan.toward, direction) * float(bitCount(seen));
    }
    if (taken == 0xFFFFFFFFu) {
      break;
    }
  }
  return sum / 32.0;
}

void main()
{
  out_arriving = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (texelFetch(surface_position, pixel, 0).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  if (max_component(s.diffuse) <= 0.0) {
    return;
  }
  vec2 turn = tile_numbers(pixel, film_view.bits_x, film_view.bits_y);
  vec2 within = tile_numbers(pixel, film_view.bits_z, film_view.bits_w);
  uvec3 roll = hash3(uvec3(uvec2(pixel), uint(film_view.sample_index * 1024 + 13)));
  for (int i = 0; i < fan_count; i++) {
    roll = hash3(roll);
    Fan fan;
    vec3 direction = cosine_direction(s.normal, fan_numbers(turn, i));
    if (fan_begin(s, gl_FragCoord.xy, direction, to_unit(roll.x), fan)) {
      out_arriving.rgb += fan_light(fan, s, fan_numbers(within, i)) / float(fan_count);
    }
  }
}
