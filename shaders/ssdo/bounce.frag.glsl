// Radiance that arrives from what the picture shows, as its cosine-weighted mean over the hemisphere: the diffuse albedo
// times this is reflected. What stands nearer on the screen hides what stands behind it.
//
// With RAYS the sectors from which the screen brings no light are not lost: one of those of all fans is traced.
#include "ssdo/fan.glsl"
#ifdef RAYS
#include "ssdo/path.glsl"
#endif

// Light of a fan, and the sectors that may hold more: all but those from which light was taken.
vec3 fan_light(Fan fan, Surface s, vec2 u, out uint open)
{
  uint taken = fan.below;
  open = ~fan.below;
  vec3 sum = vec3(0.0);
  vec2 last = vec2(0.0, view_depth(fan.origin));
  for (int i = 0; i < step_count && taken != 0xFFFFFFFFu; i++) {
    Patch found;
    if (!fan_step(fan, i, fract(u + float(i) * vec2(0.6180339887, 0.7548776662)), last, found)) {
      continue;
    }
    uint seen = found.front & ~taken;
    taken |= found.sectors;
    if (seen != 0u && found.faces) {
      vec3 path = found.position - fan.origin;
      vec3 direction = safe_normalize(path);
      vec3 radiance = senders_fetch(found.texel).rgb * passing_to(fan.origin, direction, length(path));
      sum += radiance * diffuse_weight(s, fan.toward, direction) * float(bitCount(seen));
      open &= ~seen;
    }
  }
  return sum / 32.0;
}

#ifdef RAYS
// A direction of one of a fan's sectors that are not taken.
vec3 open_direction(Fan fan, uint open, float which, float within)
{
  int skipped = min(int(which * float(bitCount(open))), bitCount(open) - 1);
  for (int i = 0; i < skipped; i++) {
    open &= open - 1u;
  }
  float sector = float(findLSB(open));
  float low = max(sector - fan.rounding, 0.0);
  float high = (sector > 30.5) ? 32.0 : sector + 1.0 - fan.rounding;
  return fan_direction(fan, mix(low, high, within) / 32.0);
}
#endif

void main()
{
  out_arriving = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  Surface s;
  if (!diffuse_surface(pixel, s)) {
    return;
  }
  vec2 turn = tile_numbers(pixel, film_view.bits_x, film_view.bits_y);
  vec2 within = tile_numbers(pixel, film_view.bits_z, film_view.bits_w);
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 13);
#ifdef RAYS
  float open_sectors = 0.0;
  vec3 chosen = s.normal;
#endif
  for (int i = 0; i < fan_count; i++) {
    roll = hash3(roll);
    Fan fan;
    vec3 direction = cosine_direction(s.normal, fan_numbers(turn, i));
    if (fan_begin(s, gl_FragCoord.xy, direction, to_unit(roll.x), fan)) {
      uint open;
      out_arriving.rgb += fan_light(fan, s, fan_numbers(within, i), open) / float(fan_count);
#ifdef RAYS
      float count = float(bitCount(open));
      open_sectors += count;
      roll = hash3(roll);
      if (count > 0.0 && to_unit(roll.x) * open_sectors < count) {
        chosen = open_direction(fan, open, to_unit(roll.y), to_unit(roll.z));
      }
#endif
    }
  }
#ifdef RAYS
  if (open_sectors > 0.0 && dot(chosen, s.geometric_normal) > 0.0) {
    vec3 found = path_radiance(ray_origin(s.position, s.geometric_normal), chosen, hash3(roll));
    vec3 weight = diffuse_weight(s, TO_VIEWER(s), chosen);
    out_arriving.rgb += found * weight * (open_sectors / (32.0 * float(fan_count)));
  }
#endif
}
