// Rays of the lobes that surfaces have kept: mirrored up to `shaded_roughness`, or bent. Of what the camera sees, or, with
// ONWARD, of what rays have met. `travelled`: how far light samples of the last lobe were from where the ray starts, m.
//
// Of smooth glass, one surface behind the other from the camera on, each way is a pass of its own (`way`): 0 goes through
// all of them, 1 is mirrored by the first, 2 by one of the others, drawn by mirror_depth. On their way to that one, rays of
// way 2 add no light: way 0 has it. So what few samples see through panes and bodies of glass is no matter of chance;
// pictures of many samples go without way 2 and leave it to chance. Way 1 is that of thin coats above other lobes, too.
//
// ELSEWHERE: from what `point` shows, drawn at another point of the pixel, where that is the same surface; of the pixel's own
// colours, as light that is found belongs to those. `ray_share`: of all points' rays.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "lib/refraction.glsl"
#include "trace/origin.glsl"
#include "hits/path.glsl"
#define TRANSMISSION  // for interface_met
#include "hits/onward.glsl"
#ifdef HAS_FROZEN_EYES
#include "edit/frozen.glsl"
#endif
#include "caustics/gloss.glsl"

#define LEAST_MIRRORED 0.05  // as in hits/surface.frag.glsl

#ifdef ELSEWHERE
#include "neighbours/pixel_size.glsl"

// The surface of a pixel with place and normals as at the other point, if that lies on it: normals within 37 degrees, two
// pixels of the tangent plane, as in film/between.frag.glsl.
Surface at_other_point(Surface s, ivec2 pixel)
{
  Surface other = surface_decode(point_position_fetch(pixel), point_normal_fetch(pixel), vec4(0.0), vec4(0.0),
                                 point_lobe_fetch(pixel), vec4(0.0));
  bool same = other.hit && other.kind == s.kind && other.coated == s.coated && dot(other.normal, s.normal) > 0.8
              && abs(dot(s.normal, other.position - s.position)) < 2.0 * pixel_size_at(s.position);
  s.position = same ? other.position : s.position;
  s.normal = same ? other.normal : s.normal;
  s.geometric_normal = same ? other.geometric_normal : s.geometric_normal;
  s.glossy_normal = same ? other.glossy_normal : s.glossy_normal;
  return s;
}
#endif

// Which surface behind the first mirrors, of paths that others let pass, and with what chance it is that one.
int mirror_depth(ivec2 pixel, out float chance)
{
  float x = shuffled(film_view.sample_index, hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 977u)).xy);
  chance = (x < 0.6) ? 0.6 : 0.4 / float(MOST_THROUGH - 1);
  return (x < 0.6) ? 1 : min(2 + int((x - 0.6) / chance), MOST_THROUGH);
}

void main()
{
  out_origin = vec4(0.0);
  out_direction = vec4(0.0);
  out_path = vec4(0.0);
  out_travelled = 0.0;
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 tint = surface_tint_fetch(pixel);
  if (surface_position_fetch(pixel).w == 0.0 || max_component(tint.rgb) <= 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
#ifdef ELSEWHERE
  s = at_other_point(s, pixel);
#endif
  bool both = surface_goes_both_ways(s);
#ifndef ONWARD
  // None end on glass, whichever way it goes.
  bool takes_photons = (photons_shine & PHOTONS_ON_GLOSS) != 0 && way == 0 && gloss_takes_photons(s);
#endif
#ifndef ONWARD
  if (way != 0) {  // of glass that goes both ways, and of coats; the other way all lobes go
    if (!both && !(way == 1 && s.coated)) {
      return;
    }
    s = (way == 1) ? (both ? surface_mirrored(s) : surface_coat(s)) : s;
  }
#endif
#ifdef ONWARD
  vec3 viewer = -met_direction_fetch(pixel).xyz;
  float width = hit_place_fetch(pixel).w;
  vec4 before = met_path_fetch(pixel);
  vec3 throughput = before.rgb * hit_passed_fetch(pixel).rgb;
  int code = int(before.w + 0.5);
  bool clear = path_is_clear(code);
  int mirrored = path_mirrors(code);
  bool edited = path_is_edited(code) || (edits_what_leaves(s) && s.glossy_ior > 1.0);
  bool has_photons = path_has_photons(code);
  code = (code & 3) + PATH_MIRROR * mirrored;
  bool through = path_goes_through(before.w);
  if (code == 0 && !through) {
    return;
  }
  code = (code == 0) ? PATH_TRANSMISSION : code;
#else
  vec3 viewer = TO_VIEWER(s);
  float width = view_pixel() * view_growth(s.position);
  vec3 throughput = vec3(ray_share);
  int code = (s.kind == LOBE_REFRACTION) ? PATH_TRANSMISSION : PATH_GLOSSY;
  bool clear = true;
  int mirrored = 0;
  bool edited = edits_what_leaves(s);
  bool through = both && way != 1;
#endif
  bool frosted = false;
  float kept = 1.0;  // chance of the way that the path takes
  bool found_by_rays = false;  // whether light samples leave out the lobe
#ifdef ONWARD
  float mirrors_of_all = max_component(fresnel_reflectance(FRESNEL_DIELECTRIC, s.glossy_tint, vec3(1.0), s.glossy_ior, dot(s.glossy_normal, viewer)));
  frosted = frosted_within(s);
  bool apart = through && both && !frosted && ray_number <= MOST_THROUGH && mirrors_of_all < 0.5;
  if (way == 2 && through && !apart) {
    return;
  }
  if (apart && way == 2) {
    through = ray_number < mirror_depth(pixel, kept);
    kept = through ? 1.0 : kept;
    found_by_rays = !through;
    s = through ? s : surface_mirrored(s);
  }
  else if (both && !apart && !frosted) {
    Surface mirror = surface_mirrored(s);
    float share = max_component(mirror.glossy_weight) / max(max_component(s.glossy_weight), 1e-6);
    float mirrored_part = (mirrors_of_all > 0.0) ? share * max(mirrors_of_all, LEAST_MIRRORED) : 0.0;
    float chance = mirrored_part / max(mirrored_part + 1.0 - mirrors_of_all, 1e-6);
    // Not 81 + ray_number: that chooses the lobe of what this ray meets (hits/surface.frag.glsl).
    uvec3 roll = roll_of(pixel, 0, film_view.seed, 601 + ray_number);
    found_by_rays = shuffled(film_view.sample_index, roll.xy) < chance;
    kept = found_by_rays ? chance : 1.0 - chance;
    s = found_by_rays ? mirror : s;
  }
  through = through && apart;
  // As in caustics/photon.frag.glsl: what rough glass or metal mirrors from outside does not shine on gloss.
  bool as_photons = s.kind == LOBE_REFRACTION || mirrors_within(s)
                    || (surface_is_mirror_of_glass(s) && lobe_is_mirror(lobe_begin(s, viewer)));
  code += (has_photons && as_photons) ? PATH_PHOTONS : 0;
#endif
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 131u + 7u * uint(ray_number)));
  vec2 u = vec2(shuffled(film_view.sample_index, salt.xy), shuffled(film_view.sample_index, salt.yz));
  vec3 weight = vec3(0.0);
  vec3 direction = vec3(0.0);
  float density = 0.0;
#ifdef ONWARD
  bool mirrored_on = lobe_goes_on(s);
#else
  bool mirrored_on = s.glossy_roughness <= shaded_roughness;  // rougher ones are gathered (indirect/near.frag.glsl)
#endif
  bool enters = false;  // whether an edit sends what leaves a solid into it again
  if (s.kind == LOBE_REFRACTION && ray_number <= interfaces) {
    Interface surface = interface_met(s, viewer, frosted && mirrored < mirrors);
    surface = interface_edited(surface, s);
    float choice = 1.0;
#ifdef ONWARD
    uvec3 roll = roll_of(pixel, 0, film_view.seed, 601 + ray_number);
    choice = frosted ? shuffled(film_view.sample_index, roll.xy) : 1.0;
#endif
    direction = interface_sample(surface, u, choice, weight);
    interface_value(surface, direction, density);
    bool mirrors_it = choice < 1.0 && dot(direction, surface.normal) > 0.0;
#ifdef ONWARD
    // Samples of lights for the last lobe that mirrored pass glass on straight lines, and share what is behind it; those of
    // the surface that the camera sees are of another number, and its lobe counts as several rays (light/direct.frag.glsl).
    if (mirrored > 0 && density == 0.0 && dot(direction, surface.normal) < 0.0) {
      density = met_direction_fetch(pixel).w * ((ray_number == 1) ? first_rays : 1.0);
      out_travelled = met_travelled_fetch(pixel).x + distance(met_origin_fetch(pixel).xyz, s.position);
    }
#endif
    density = mirrors_it ? 0.0 : density;  // light samples leave that out
    weight *= ((dot(direction, s.geometric_normal) < 0.0) != mirrors_it || surface_is_edited(s)) ? 1.0 : 0.0;
#ifdef HAS_FROZEN_EYES
    if (edits_what_leaves(s) && s.glossy_ior > 1.0 && dot(direction, surface.normal) < 0.0) {
      direction = entering_frozen(s, surface_edit_fetch(pixel), viewer, direction);
    }
#endif
#ifdef HAS_CARRIED_EDIT
    if (edited && s.glossy_ior <= 1.0 && dot(direction, surface.normal) < 0.0) {  // what leaves an edited object goes where the edit turns it
      vec4 edit = carried_edit_fetch(pixel);
      direction = quaternion_turned(edit / max(length(edit), 1e-30), direction);
      edited = false;
      enters = dot(direction, s.geometric_normal) > 0.0;
      density = 0.0;  // light samples leave that out, too (hits/received.frag.glsl)
    }
#endif
    code += (edited ? PATH_EDITED : 0);
    code += mirrors_it ? PATH_MIRROR : PATH_BENT + ((clear && s.glossy_roughness <= clear_roughness) ? PATH_CLEAR : 0);
  }
  else if (s.kind <= FRESNEL_F82 && mirrored_on && mirrored < mirrors) {
    Lobe lobe = lobe_begin(s, viewer);
    direction = lobe_sample(lobe, u, weight);
    lobe_reflection(lobe, direction, density);
    weight *= may_mirror(s, direction) ? 1.0 : 0.0;
    code += PATH_MIRROR + (edited ? PATH_EDITED : 0);
#ifndef ONWARD
    density = (s.glossy_roughness > traced_roughness) ? FOUND_ELSEWHERE : density;
    density = (enters_itself(s, direction) && density != FOUND_ELSEWHERE) ? 0.0 : density;  // light samples leave that out
    code += takes_photons ? PATH_PHOTONS : 0;
#endif
  }
  throughput *= weight / max(kept, 1e-6);
  density = found_by_rays ? 0.0 : density;
  float most = max_component(throughput);
  if (!(most > 1e-4 * ray_share) || !is_finite(most)) {
    return;
  }
  vec3 side = ((code & PATH_BENT) != 0 && !enters) ? -s.geometric_normal : side_of_ray(s, direction);
  side = (dot(side, direction) < 0.0 && surface_is_edited(s)) ? -side : side;
  out_origin = vec4(ray_origin(s.position, side), width);
  if (enters || ((code & PATH_BENT) == 0 && enters_itself(s, direction))) {
    out_origin.w = -width;
  }
  out_direction = vec4(direction, density);
  out_path = vec4(throughput, (through && way == 2) ? PATH_THROUGH : float(code) + (through ? PATH_THROUGH : 0.0));
}
