// Photons of a light's view by look-ups in images alone: one refraction or two, or one reflection, and the receiver that the
// bent ray meets (Shah, Konttinen & Pattanaik 2007, with a bracketed root in place of its fixed point).
//
// `film_view` is the view of the casters; surface_* hold what light meets first of them, behind_* what it would leave last if
// it went straight. `map_view` is that of the receivers, receiver_* its images. Output as of caustics/photon.frag.glsl.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/refraction.glsl"
#include "light/sources.glsl"
#include "caustics/emission.glsl"
#include "caustics/arrival.glsl"

#define STEPS 14
#define REFINED 3
#define RECEIVER_STEPS 30
#define FIRST_STEP 0.2  // of the way to the receivers
#define STEP_GROWTH 1.22

// Distance along a view's axis, and the texel of an image of `size` that a place projects to.
float view_depth(View view, vec3 place)
{
  return dot(place - view.eye.xyz, -view.backward.xyz);
}

bool view_texel(View view, vec3 place, vec2 size, out ivec2 texel)
{
  vec4 p = vec4(place, 1.0);
  float w = dot(view.row_w, p);
  vec2 at = (vec2(dot(view.row_x, p), dot(view.row_y, p)) / max(w, 1e-30) * 0.5 + 0.5) * size;
  texel = ivec2(at);
  return w > 0.0 && all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, size));
}

// How far a place lies behind the last surface of the caster; beside the caster it is out of it.
float behind_caster(vec3 place, float start, out ivec2 texel)
{
  if (!view_texel(film_view, place, vec2(behind_position_size()), texel)) {
    return start;
  }
  vec4 there = behind_position_fetch(texel);
  return (there.w == 0.0) ? start : view_depth(film_view, place) - view_depth(film_view, there.xyz);
}

// Normal of the caster's last surface at a place, between the four texels around it that are alike.
vec3 normal_behind(vec3 place, vec3 nearest)
{
  vec4 p = vec4(place, 1.0);
  ivec2 size = behind_position_size();
  float w = max(dot(film_view.row_w, p), 1e-30);
  vec2 at = (vec2(dot(film_view.row_x, p), dot(film_view.row_y, p)) / w * 0.5 + 0.5) * vec2(size) - 0.5;
  vec2 corner = floor(at);
  vec2 share = at - corner;
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 4; k++) {
    vec2 step = vec2(float(k & 1), float(k >> 1));
    ivec2 other = clamp(ivec2(corner + step), ivec2(0), size - 1);
    vec3 normal = octahedral_decode(behind_lobe_fetch(other).xy);
    vec2 tent = mix(vec2(1.0) - share, share, step);
    bool alike = behind_position_fetch(other).w != 0.0 && dot(normal, nearest) > 0.9;
    sum += (alike ? tent.x * tent.y : 0.0) * normal;
  }
  return (dot(sum, sum) > 1e-6) ? safe_normalize(sum) : nearest;
}

// How far behind the receivers that the light sees; -1e30 where it sees none.
float behind_receiver(vec3 place, out ivec2 texel)
{
  if (!view_texel(map_view, place, vec2(receiver_position_size()), texel)) {
    return -1e30;
  }
  vec4 there = receiver_position_fetch(texel);
  return (there.w == 0.0) ? -1e30 : view_depth(map_view, place) - view_depth(map_view, there.xyz);
}

void main()
{
  out_point = vec4(0.0);
  out_normal = vec4(0.0);
  out_flux = vec4(0.0);
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = surface_position_fetch(texel);
  bool inside = all(greaterThanEqual(place.xyz, photon_light.box_low.xyz)) && all(lessThanEqual(place.xyz, photon_light.box_high.xyz));
  if (place.w == 0.0 || !inside || max_component(surface_tint_fetch(texel).rgb) <= 0.0) {
    return;
  }
  Surface s = SURFACE_READ(texel);
  bool bends = photon_light.bends != 0;
  bool wanted = bends ? s.kind == LOBE_REFRACTION : s.kind < LOBE_REFRACTION;
  if (!wanted || (!bends && s.glossy_roughness > photon_light.box_high.w)) {
    return;
  }
  float away;
  float area;
  vec3 direction;
  vec3 flux = texel_flux(s.position, direction, away, area);
  if (!(max_component(abs(flux)) > 0.0)) {
    return;
  }
  bool parallel = view_is_parallel(film_view.eye);
  vec3 weight;
  vec3 onward;
  float lobe_spread;
  if (bends) {
    Interface surface = interface_begin(s.glossy_normal, -direction, s.glossy_roughness, s.glossy_ior, s.glossy_tint,
                                        s.glossy_edge.x > 0.5, s.glossy_weight, vec3(0.0));
    onward = interface_sample(surface, photon_light.lobe.xy, 1.0, weight);
    lobe_spread = interface_is_smooth(surface) ? 0.0 : lobe_width(surface.alpha, true, s.glossy_ior);
  }
  else {
    Lobe lobe = lobe_begin(s, -direction);
    onward = lobe_sample(lobe, photon_light.lobe.xy, weight);
    lobe_spread = lobe_is_mirror(lobe) ? 0.0 : lobe_width(sqrt(lobe.alpha.x * lobe.alpha.y), false, 1.0);
  }
  if (bends != (dot(onward, s.geometric_normal) < 0.0)) {
    return;
  }
  flux *= bends ? weight / (s.glossy_ior * s.glossy_ior) : weight;  // see caustics/photon.frag.glsl
  vec3 from = s.position;
  float travelled = 0.0;
  float extent = length(photon_light.box_high.xyz - photon_light.box_low.xyz);

  ivec2 own;
  vec4 last = vec4(0.0);
  if (bends && view_texel(film_view, s.position, vec2(behind_position_size()), own)) {
    last = behind_position_fetch(own);
  }
  // A single sheet, as water is, has no second surface.
  if (last.w != 0.0 && distance(last.xyz, s.position) > 1e-3 * extent) {
    float low = 0.0;
    float high = 0.0;
    ivec2 met = own;
    bool found = false;
    for (int k = 1; k <= STEPS && !found; k++) {
      high = extent * float(k) / float(STEPS);
      ivec2 there;
      found = behind_caster(from + high * onward, 1.0, there) >= 0.0;
      low = found ? low : high;
    }
    for (int k = 0; k < 2 * REFINED; k++) {
      float middle = 0.5 * (low + high);
      ivec2 there;
      bool behind = behind_caster(from + middle * onward, 1.0, there) >= 0.0;
      low = behind ? low : middle;
      high = behind ? middle : high;
    }
    behind_caster(from + low * onward, 1.0, met);
    Surface leaving = surface_decode(behind_position_fetch(met), behind_normal_fetch(met), vec4(0.0, 0.0, 0.0, 0.0),
                                     behind_tint_fetch(met), behind_lobe_fetch(met), behind_emission_fetch(met));
    if (!leaving.hit || leaving.kind != LOBE_REFRACTION) {
      return;
    }
    // Where the ray meets the plane of the surface at that texel.
    float slope = dot(leaving.geometric_normal, onward);
    float t = (abs(slope) > 0.05) ? dot(leaving.geometric_normal, leaving.position - from) / slope : low;
    t = clamp(t, max(low - 0.1 * extent, 0.0), low + 0.1 * extent);
    flux *= passing_media(from, onward, t);
    from += t * onward;
    travelled += t;
    flux *= exp(-photon_light.absorbed.rgb * t);
    vec3 facing = normal_behind(from, leaving.glossy_normal);
    facing = (dot(facing, onward) > 0.0) ? -facing : facing;
    Interface surface = interface_begin(facing, -onward, leaving.glossy_roughness, leaving.glossy_ior,
                                        leaving.glossy_tint, leaving.glossy_edge.x > 0.5, leaving.glossy_weight, vec3(0.0));
    onward = interface_sample(surface, fract(photon_light.lobe.xy + vec2(0.754877666, 0.569840291)), 1.0, weight);
    if (max_component(weight) <= 0.0) {
      return;
    }
    flux *= weight / (leaving.glossy_ior * leaving.glossy_ior);
  }

  // Steps grow along the ray, from a part of the way to the receivers straight ahead.
  ivec2 met = ivec2(0);
  float gap = -behind_receiver(from, met);
  float low = 0.0;
  float high = FIRST_STEP * ((gap > 0.0 && gap < 1e29) ? gap : extent);
  bool found = false;
  for (int k = 0; k < RECEIVER_STEPS && !found; k++) {
    ivec2 there;
    found = behind_receiver(from + high * onward, there) >= 0.0;
    low = found ? low : high;
    high *= found ? 1.0 : STEP_GROWTH;
  }
  if (!found) {
    return;
  }
  for (int k = 0; k < 4 * REFINED; k++) {
    float middle = 0.5 * (low + high);
    ivec2 there;
    bool behind = behind_receiver(from + middle * onward, there) >= 0.0;
    low = behind ? low : middle;
    high = behind ? middle : high;
  }
  behind_receiver(from + high * onward, met);
  vec4 receiver = receiver_position_fetch(met);
  vec3 normal = octahedral_decode(receiver_normal_fetch(met).zw);
  float slope = dot(normal, onward);
  if (receiver.w == 0.0 || slope >= -1e-3) {
    return;
  }
  float t = dot(normal, receiver.xyz - from) / slope;
  if (abs(t - high) > 0.1 * high) {
    return;
  }
  travelled += t;
  flux *= passing_media(from, onward, t);
  float light_spread = photon_light.spread.x * (parallel ? 1.0 : 1.0 / max(away, 1e-30)) * travelled;
  float lobes = photon_light.spread.y * lobe_spread * travelled;
  out_point = vec4(from + t * onward, bends ? 1.0 : 2.0);
  out_normal = vec4(octahedral_encode(normal), arrival_encode(-onward, false, true), sqrt(light_spread * light_spread + lobes * lobes));
  out_flux = vec4(flux, sqrt(area) * (parallel ? 1.0 : (away + travelled) / away));
}
