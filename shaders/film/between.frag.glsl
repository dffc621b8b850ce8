// What a surface seen at another point of the film sends to the eye, of the light that was found at the pixels' own
// points (`known`): light arrives there as at the nearest of those where that lies on the same surface, else as at the
// pixels around it that do, else as nearby; and leaves by the colours of the surface that is seen.
// REPEATED: where the nearest own point lies elsewhere, and the light of pixels around that lie there is not even, direct
// light is left out, but for that through glass, and the pixel marked by its depth (lighting/repeated_light.py).
// WRITE_ALL: light paths to the images that are drawn, several summed up in one (film/points.py).
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "neighbours/pixel_size.glsl"

#define REACH 4  // pixels to look at, on each side: until some have light (wires)
#define COATED 16  // beside a kind of lobe: with a coat above it
#define LEAST_COLOR 1e-5  // what is darker tells nothing of the light that arrives

struct Seen {
  bool hit;
  vec3 position;
  vec3 normal;
  vec3 color;   // of all that is diffuse
  bool soft;    // with a diffuse lobe in it
  int kind;     // of the other lobe
  vec3 weight;  // of it, times about what it reflects towards the viewer; 0: there is none
  vec3 mirror;  // the same of what glass mirrors that goes both ways
};

// About what share of the light a lobe reflects towards the viewer. Of several lobes of a surface each pixel has drawn one:
// a coat that hardly reflects, drawn seldom and of great weight, or the metal below it. Light that is passed on by the
// weights alone would be far too bright.
vec3 lobe_reflectance(Surface s)
{
  vec3 to_viewer = TO_VIEWER(s);
  float cosine = clamp(abs(dot(s.glossy_normal, to_viewer)), 0.0, 1.0);
  if (s.kind == FRESNEL_DIELECTRIC) {
    float least = dielectric_f0(s.glossy_ior);
    float rise = (fresnel_dielectric(cosine, s.glossy_ior) - least) / max(1.0 - least, 1e-6);
    return mix(s.glossy_tint, vec3(1.0), clamp(rise, 0.0, 1.0));
  }
  if (s.kind == FRESNEL_F82) {
    return mix(s.glossy_tint, vec3(1.0), pow(1.0 - cosine, 5.0));
  }
  return (s.kind == FRESNEL_NONE) ? s.glossy_tint : vec3(1.0);
}

Seen seen_of(Surface s)
{
  Seen seen;
  seen.hit = s.hit;
  seen.position = s.position;
  seen.normal = s.normal;
  seen.kind = s.kind;
  seen.soft = has_diffuse_lobe(s);
  seen.color = diffuse_color(s);
  seen.weight = seen.soft ? vec3(0.0) : s.glossy_weight * lobe_reflectance(s);
  if (s.coated) {
    // What two lobes reflect together no colour tells: it is taken over as it is, of other such pixels.
    seen.kind += COATED;
    seen.weight = vec3(1.0);
  }
  seen.mirror = vec3(0.0);
#ifdef TRANSMISSION
  if (surface_goes_both_ways(s)) {
    Surface mirrored = surface_mirrored(s);
    seen.mirror = mirrored.glossy_weight * lobe_reflectance(mirrored);
  }
#endif
  return seen;
}

// At this point of the film.
Seen seen_here(ivec2 pixel)
{
  return seen_of(surface_decode(surface_position_fetch(pixel), surface_normal_fetch(pixel),
                                surface_diffuse_fetch(pixel), surface_tint_fetch(pixel),
                                surface_lobe_fetch(pixel), vec4(0.0)));
}

// At a pixel's own point, where its light is known.
Seen seen_there(ivec2 pixel)
{
  return seen_of(surface_decode(known_position_fetch(pixel), known_normal_fetch(pixel),
                                known_diffuse_fetch(pixel), known_tint_fetch(pixel),
                                known_lobe_fetch(pixel), vec4(0.0)));
}

vec3 known_part(vec3 color)
{
  return step(vec3(LEAST_COLOR), color);
}

// Sums over pixels of one kind of light, and of the colours by which their surfaces show it.
struct Arriving {
  vec3 direct;
  vec3 indirect;
  vec3 whole;
};

// `weight` of the light, and of what it is divided by: where they differ, less light is left.
void arriving_add(inout Arriving sum, vec3 direct, vec3 indirect, vec3 color, float weight, float whole)
{
  vec3 known = known_part(color);
  sum.direct += known * direct * weight;
  sum.indirect += known * indirect * weight;
  sum.whole += known * color * whole;
}

bool arriving_enough(Arriving sum, vec3 color)
{
  vec3 missing = known_part(color) * (1.0 - step(vec3(1e-20), sum.whole));
  return max_component(missing) <= 0.0;
}

#ifdef REPEATED
#define EVEN 0.3  // share of the light by which it may differ
#define LIKE 0.99  // cosine of an angle by which a highlight may turn
// How much the direct light differs that arrives at pixels on one surface, and whether all face alike.
struct Spread {
  float least;
  float most;
  int count;
  bool alike;
};

void spread_add(inout Spread spread, vec3 direct, vec3 color, bool like)
{
  float shown = luminance(color);
  spread.alike = spread.alike && like;
  if (shown > LEAST_COLOR) {
    float arriving = luminance(direct) / shown;
    spread.least = min(spread.least, arriving);
    spread.most = max(spread.most, arriving);
    spread.count++;
  }
}

bool spread_is_even(Spread spread, Arriving same, vec3 color)
{
  bool even = spread.alike && spread.count >= 2 && spread.most - spread.least <= EVEN * spread.most;
  return luminance(color) <= LEAST_COLOR || (even && arriving_enough(same, color));
}
#endif

// Of `same` where it is known, else of `nearby`.
void arriving_mean(Arriving same, Arriving nearby, out vec3 direct, out vec3 indirect)
{
  vec3 known = step(vec3(1e-20), same.whole);
  vec3 same_whole = max(same.whole, vec3(1e-20));
  vec3 nearby_whole = max(nearby.whole, vec3(1e-20));
  direct = mix(nearby.direct / nearby_whole, same.direct / same_whole, known);
  indirect = mix(nearby.indirect / nearby_whole, same.indirect / same_whole, known);
}

struct Reflected {
  vec4 diffuse_direct;
  vec4 diffuse_indirect;
  vec4 glossy_direct;
  vec4 glossy_indirect;
  vec4 transmission_direct;
  vec4 transmission_indirect;
  bool repeated;  // the pixel is marked
};

Reflected reflected(ivec2 pixel)
{
  ivec2 size = known_position_size();
  ivec2 nearest = clamp(pixel + ivec2(floor(offset + 0.5)), ivec2(0), size - 1);  // whose own point lies next to this one
  vec2 beside = offset - vec2(nearest - pixel);
  Reflected light;
  light.diffuse_direct = vec4(0.0);
  light.diffuse_indirect = vec4(0.0);
  light.glossy_direct = vec4(0.0);
  light.glossy_indirect = vec4(0.0);
  light.transmission_direct = vec4(0.0);
  light.transmission_indirect = vec4(0.0);
  light.repeated = false;
  Seen here = seen_here(pixel);
  if (!here.hit) {
    return light;
  }
  float tolerance = 2.0 * pixel_size_at(here.position);
  Arriving none;
  none.direct = vec3(0.0);
  none.indirect = vec3(0.0);
  none.whole = vec3(0.0);
  Arriving same = none;
  Arriving nearby = none;
  Arriving same_lobe = none;
  Arriving nearby_lobe = none;
#ifdef TRANSMISSION
  Arriving same_mirror = none;
  Arriving nearby_mirror = none;
  bool refracts = here.kind == LOBE_REFRACTION;
#endif
#ifdef REPEATED
  bool own = false;
  Spread spread;
  spread.least = 1e30;
  spread.most = 0.0;
  spread.count = 0;
  spread.alike = true;
  Spread lobe_spread = spread;
#endif
  bool light_found = false;
  bool lobe_found = false;
  for (int reach = 0; reach <= REACH && !(light_found && lobe_found); reach++) {
    for (int y = -reach; y <= reach; y++) {
      for (int x = -reach; x <= reach; x++) {
        ivec2 other = nearest + ivec2(x, y);
        if (max(abs(x), abs(y)) < reach) {
          continue;  // looked at before
        }
        if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, size))) {
          continue;
        }
        Seen there = seen_there(other);
        if (!there.hit) {
          continue;
        }
        vec2 off = abs(vec2(float(x), float(y)) - beside);
        float weight = max(1.5 - off.x, 0.01) * max(1.5 - off.y, 0.01);
        float facing = dot(here.normal, there.normal);
        bool equal = facing > 0.8 && abs(dot(here.normal, there.position - here.position)) < tolerance;
#ifdef REPEATED
        own = own || (reach == 0 && equal && (facing > LIKE || max_component(here.weight) <= 0.0));
#endif
        // Where no pixel is on the surface: at outlines, which turn away within a pixel, rather of what is close.
        float alike = max(facing, 0.1) * max(facing, 0.1);
        vec3 apart = (there.position - here.position) / tolerance;
        float similar = weight * alike * alike / (1.0 + dot(apart, apart));
        if (!light_found) {
          vec3 direct = light_diffuse_direct_fetch(other).rgb;
          vec3 indirect = light_diffuse_indirect_fetch(other).rgb;
          if (equal && here.soft == there.soft) {
            arriving_add(same, direct, indirect, there.color, weight, weight);
#ifdef REPEATED
            spread_add(spread, direct, there.color, true);
#endif
          }
          arriving_add(nearby, direct, indirect, there.color, similar, similar);
        }
        if (!lobe_found && here.kind == there.kind) {
          vec3 direct = light_glossy_direct_fetch(other).rgb;
          vec3 indirect = light_glossy_indirect_fetch(other).rgb;
#ifdef TRANSMISSION
          if (refracts) {
            direct = light_transmission_direct_fetch(other).rgb;
            indirect = light_transmission_indirect_fetch(other).rgb;
          }
#endif
          if (equal) {
            arriving_add(same_lobe, direct, indirect, there.weight, weight, weight);
#ifdef REPEATED
            spread_add(lobe_spread, direct, there.weight, facing > LIKE);
#endif
          }
          // Of a highlight that only what faces another way is known to show, hardly anything is taken.
          arriving_add(nearby_lobe, direct, indirect, there.weight, similar, weight);
#ifdef TRANSMISSION
          if (max_component(here.mirror) > 0.0) {
            direct = light_glossy_direct_fetch(other).rgb;
            indirect = light_glossy_indirect_fetch(other).rgb;
            if (equal) {
              arriving_add(same_mirror, direct, indirect, there.mirror, weight, weight);
#ifdef REPEATED
              spread_add(lobe_spread, direct, there.mirror, facing > LIKE);
#endif
            }
            arriving_add(nearby_mirror, direct, indirect, there.mirror, similar, weight);
          }
#endif
        }
      }
    }
    light_found = arriving_enough(same, here.color) || (reach > 0 && arriving_enough(nearby, here.color));
    lobe_found = arriving_enough(same_lobe, here.weight) || (reach > 0 && arriving_enough(nearby_lobe, here.weight));
  }
  vec3 direct;
  vec3 indirect;
  arriving_mean(same, nearby, direct, indirect);
#ifdef REPEATED
  own = own || (spread_is_even(spread, same, here.color) && spread_is_even(lobe_spread, same_lobe, here.weight));
  light.repeated = !own;
  if (!own) {
    direct = vec3(0.0);
  }
#endif
  light.diffuse_direct.rgb = here.color * direct;
  light.diffuse_indirect.rgb = here.color * indirect;
  arriving_mean(same_lobe, nearby_lobe, direct, indirect);
  direct *= here.weight;
  indirect *= here.weight;
#ifdef TRANSMISSION
  if (refracts) {
    // How much of the world shows through is the nearest pixel's, by the lobes' weights.
    float share = luminance(here.weight) / max(luminance(seen_there(nearest).weight), 1e-6);
    light.transmission_direct = vec4(direct, light_transmission_direct_fetch(nearest).a * min(share, 4.0));
    light.transmission_indirect = vec4(indirect, light_transmission_indirect_fetch(nearest).a * min(share, 4.0));
    arriving_mean(same_mirror, nearby_mirror, direct, indirect);
    light.glossy_direct.rgb = here.mirror * direct;
    light.glossy_indirect.rgb = here.mirror * indirect;
#ifdef REPEATED
    light.glossy_direct.rgb *= own ? 1.0 : 0.0;
#endif
    return light;
  }
#endif
#ifdef REPEATED
  direct *= own ? 1.0 : 0.0;
#endif
  light.glossy_direct.rgb = direct;
  light.glossy_indirect.rgb = indirect;
  return light;
}

void main()
{
  Reflected light = reflected(ivec2(gl_FragCoord.xy));
#ifdef REPEATED
  gl_FragDepth = light.repeated ? 1.0 : 0.0;
#endif
  WRITE_ALL
}
