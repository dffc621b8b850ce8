// Light of the world that what the picture shows does not hide, as its cosine-weighted mean over the hemisphere.
//
// Eight sectors of a fan share one direction, in which the world is read from a map that is blurred about as far.
//
// With RAYS each fan asks with one ray whether what the picture does not show hides the light that is left, in a direction
// drawn in proportion to it.
#include "ssdo/fan.glsl"
#include "lib/environment.glsl"
#ifdef RAYS
#include "trace/rays.glsl"
#endif

#define GROUP 8

uint fan_hidden(Fan fan, vec2 u)
{
  uint hidden = fan.below;
  vec2 last = vec2(0.0, view_depth(fan.origin));
  for (int i = 0; i < step_count && hidden != 0xFFFFFFFFu; i++) {
    Patch found;
    if (fan_step(fan, i, fract(u + float(i) * vec2(0.6180339887, 0.7548776662)), last, found)) {
      hidden |= found.sectors;
    }
  }
  return hidden;
}

vec3 fan_environment(Fan fan, Surface s, uint hidden, vec2 u, uint salt)
{
  vec3 sum = vec3(0.0);
  vec3 chosen = s.normal;
  for (int group = 0; group < 32 / GROUP; group++) {
    uint open = ~(hidden >> uint(group * GROUP)) & ((1u << uint(GROUP)) - 1u);
    if (open != 0u) {
      vec3 direction = fan_direction(fan, (float(group) + u.x) * (float(GROUP) / 32.0));
      vec3 light = environment_radiance(direction) * diffuse_weight(s, fan.toward, direction) * float(bitCount(open));
      light *= passing_to(s.position, direction, 1e29);
      sum += light;
      float share = luminance(abs(light)) / max(luminance(abs(sum)), 1e-30);
      bool taken = u.y < share;
      chosen = taken ? direction : chosen;
      u.y = clamp(taken ? u.y / max(share, 1e-7) : (u.y - share) / max(1.0 - share, 1e-7), 0.0, 0.999999);
    }
  }
#ifdef RAYS
  if (max_component(abs(sum)) > 0.0) {
    sum *= clear_path(ray_origin(s.position, s.geometric_normal), chosen, 1e29, salt);
  }
#endif
  return sum / 32.0;
}

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
  for (int i = 0; i < fan_count; i++) {
    roll = hash3(roll);
    Fan fan;
    vec3 direction = cosine_direction(s.normal, fan_numbers(turn, i));
    if (fan_begin(s, gl_FragCoord.xy, direction, to_unit(roll.x), fan)) {
      uint hidden = fan_hidden(fan, fan_numbers(within, i));
      out_arriving.rgb += fan_environment(fan, s, hidden, vec2(to_unit(roll.y), to_unit(roll.z)), roll.x) / float(fan_count);
    }
  }
}
