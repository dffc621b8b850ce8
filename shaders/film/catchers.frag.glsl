// The picture of a scene with shadow catchers, of the three that addon/film/catcher.py describes: as change_of and
// composed there. Where only things are known, catchers are left out.
#include "lib/math.glsl"

#define SURE 0.5
#define LEAST 0.01

vec4 sound(vec4 value)
{
  for (int k = 0; k < 4; k++) {
    value[k] = is_finite(value[k]) ? value[k] : 0.0;
  }
  return value;
}

// rgb: light of the catchers in `all`; w: the share of the pixel that shows them.
vec4 of_catchers(ivec2 pixel)
{
  vec4 whole = sound(everything_fetch(pixel)), own = sound(things_fetch(pixel));
  return vec4(whole.rgb - own.rgb, clamp(whole.a - own.a, 0.0, 1.0));
}

vec3 per_unit(vec4 lit)
{
  return max(lit.rgb, vec3(0.0)) / max(lit.a, LEAST);
}

vec3 change_at(ivec2 pixel, vec4 now)
{
  vec4 alone = sound(plate_fetch(pixel));
  if (now.a <= LEAST || alone.a <= LEAST) {
    return vec3(1.0);
  }
  if (now.a < SURE) {  // at their rims things bring noise of their own, which little of a catcher would enlarge
    now = alone = vec4(0.0);
    ivec2 size = things_size();
    for (int k = 0; k < 9; k++) {
      ivec2 near = pixel + ivec2(k % 3 - 1, k / 3 - 1);
      if (near.x >= 0 && near.y >= 0 && near.x < size.x && near.y < size.y) {
        now += of_catchers(near);
        alone += sound(plate_fetch(near));
      }
    }
  }
  vec3 lit = per_unit(now), whole = per_unit(alone), ratio = vec3(1.0);
  for (int k = 0; k < 3; k++) {
    if (whole[k] > 0.0) {
      ratio[k] = lit[k] / whole[k];
    }
  }
  float alpha = transparent == 1 ? clamp(sound(everything_fetch(pixel)).a, 0.0, 1.0) : 1.0;
  return mix(vec3(1.0), ratio, alpha);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 own = sound(things_fetch(pixel)), seen = sound(seen_fetch(pixel));
  float shown = 0.0, mean = 1.0;
  if (known == 1) {
    vec4 now = of_catchers(pixel);
    vec3 change = change_at(pixel, now);
    shown = now.a;
    mean = clamp((change.r + change.g + change.b) / 3.0, 0.0, 1.0);
  }
  if (transparent == 1) {
    out_color = vec4(seen.rgb, seen.a + (1.0 - seen.a) * (1.0 - mean));
  } else {
    float share = clamp(shown / clamp(1.0 - own.a, LEAST, 1.0), 0.0, 1.0);  // of what things leave open
    out_color = vec4(seen.rgb + world_scale * sound(world_fetch(pixel)).rgb * (1.0 - share + share * mean), 1.0);
  }
}
