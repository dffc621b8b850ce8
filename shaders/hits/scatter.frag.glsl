// Rays of the lobes that surfaces have kept: mirrored up to `shaded_roughness`, or bent. Of what the camera sees, or, with
// ONWARD, of what rays have met. `travelled`: how far light samples of the last lobe were from where the ray starts, m.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "lib/refraction.glsl"
#include "trace/origin.glsl"
#include "hits/path.glsl"
#include "hits/onward.glsl"

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
#ifndef ONWARD
  if (mirrored_way != 0) {  // of glass that goes both ways; the other way all lobes go
    if (!surface_goes_both_ways(s)) {
      return;
    }
    s = surface_mirrored(s);
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
  code = (code & 3) + PATH_MIRROR * mirrored;
  if (code == 0) {
    return;
  }
#else
  vec3 viewer = TO_VIEWER(s);
  float width = view_pixel() * view_growth(s.position);
  vec3 throughput = vec3(1.0);
  int code = (s.kind == LOBE_REFRACTION) ? PATH_TRANSMISSION : PATH_GLOSSY;
  bool clear = true;
  int mirrored = 0;
  bool edited = edits_what_leaves(s);
#endif
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 131u + 7u * uint(ray_number)));
  vec2 u = vec2(shuffled(film_view.sample_index, salt.xy), shuffled(film_view.sample_index, salt.yz));
  vec3 weight = vec3(0.0);
  vec3 direction = vec3(0.0);
  float density = 0.0;
  bool enters = false;  // whether an edit sends what leaves a solid into it again
  if (s.kind == LOBE_REFRACTION && ray_number <= interfaces) {
    Interface surface = interface_begin(s.glossy_normal, viewer, s.glossy_roughness, s.glossy_ior, s.glossy_tint,
                                        s.glossy_edge.x > 0.5, s.glossy_weight, vec3(0.0));
    surface = interface_edited(surface, s);
    direction = interface_sample(surface, u, 1.0, weight);
    interface_value(surface, direction, density);
#ifdef ONWARD
    // Samples of lights for the last lobe that mirrored pass glass on straight lines, and share what is behind it; those of
    // the surface that the camera sees are of another number, and its lobe counts as several rays (light/direct.frag.glsl).
    if (mirrored > 0 && density == 0.0 && dot(direction, surface.normal) < 0.0) {
      density = met_direction_fetch(pixel).w * ((ray_number == 1) ? first_rays : 1.0);
      out_travelled = met_travelled_fetch(pixel).x + distance(met_origin_fetch(pixel).xyz, s.position);
    }
#endif
    weight *= (dot(direction, s.geometric_normal) < 0.0 || surface_is_edited(s)) ? 1.0 : 0.0;
#ifdef HAS_CARRIED_EDIT
    if (edited && s.glossy_ior <= 1.0 && dot(direction, surface.normal) < 0.0) {  // what leaves an edited object goes where the edit turns it
      vec4 edit = carried_edit_fetch(pixel);
      direction = quaternion_turned(edit / max(length(edit), 1e-30), direction);
      edited = false;
      enters = dot(direction, s.geometric_normal) > 0.0;
    }
#endif
    code += PATH_BENT + ((clear && s.glossy_roughness <= clear_roughness) ? PATH_CLEAR : 0) + (edited ? PATH_EDITED : 0);
  }
  else if (s.kind <= FRESNEL_F82 && lobe_goes_on(s) && mirrored < mirrors) {
    Lobe lobe = lobe_begin(s, viewer);
    direction = lobe_sample(lobe, u, weight);
    lobe_reflection(lobe, direction, density);
    weight *= may_mirror(s, direction) ? 1.0 : 0.0;
    code += PATH_MIRROR + (edited ? PATH_EDITED : 0);
#ifndef ONWARD
    density = (s.glossy_roughness > traced_roughness) ? FOUND_ELSEWHERE : density;
#endif
  }
  throughput *= weight;
  float most = max_component(throughput);
  if (!(most > 1e-4) || !is_finite(most)) {
    return;
  }
  vec3 side = ((code & PATH_BENT) != 0 && !enters) ? -s.geometric_normal : side_of_ray(s, direction);
  side = (dot(side, direction) < 0.0 && surface_is_edited(s)) ? -side : side;
  out_origin = vec4(ray_origin(s.position, side), width);
  if (enters || ((code & PATH_BENT) == 0 && enters_itself(s, direction))) {
    out_origin.w = -width;
  }
  out_direction = vec4(direction, density);
  out_path = vec4(throughput, float(code));
}
