// Indirect light of this sample: virtual lights, bounded where they are near, and rays for what the bound leaves out.
//
// Both kernels are shares of the same light: a virtual light at distance d counts min(1, d2 / r2), a ray that meets a
// surface at distance d counts 1 - min(1, d2 / r2). With SHARED, regions of pixels have gathered the virtual lights
// (region_gather.comp.glsl).
#include "indirect/path.glsl"
#include "indirect/lights.glsl"
#ifndef SHARED
#include "indirect/traced_gather.glsl"
#endif
#ifdef SOFT
#include "lib/soft_lobe.glsl"
#endif

// Radiance that arrives along a ray from surfaces nearer than the bound (from all surfaces, if `whole`), each with the
// share that virtual lights leave to it, and what reaches those surfaces in the same way: that last light, of which there is
// little and which takes most of the time where small things stand close, only some samples look for (`deeper`: the
// weight that it has in them, 0 in the others). Behind a `whole` ray, of a lobe, the bound is `glossy_radius`: paths between
// surfaces that shine bring much by few, and no filter spreads that.
vec3 near_radiance(vec3 origin, vec3 direction, bool whole, uvec3 roll)
{
  vec3 sum = vec3(0.0);
  vec3 throughput = vec3(1.0);
  float reach = whole ? glossy_radius : near_radius;
  for (int bounce = 1; bounce <= bounces; bounce++) {
    Vertex met;
    float t;
    float limit = (whole && bounce == 1) ? 1e29 : reach;
    if (!trace_vertex(origin, direction, limit, roll.z, met, t)) {
      break;
    }
    float share = (whole && bounce == 1) ? 1.0 : 1.0 - t * t / (reach * reach);
    throughput *= share;
    if (max_component(throughput) <= 1e-4) {
      break;
    }
    roll = hash3(roll);
    sum += throughput * direct_reflected(met, -direction, 1, roll.x);
    if (bounce < bounces) {
      vec3 from;
      vec3 arriving = virtual_irradiance(met.position, met.lit, reach, roll.z, from);
      sum += throughput * arriving * reflection_of(met.reflection, met.lit, from, -direction);
    }
    if (bounce == 1) {
      if (deeper <= 0.0) {
        break;
      }
      throughput *= deeper;
    }
    roll = hash3(roll);
    vec3 onward = cosine_direction(met.lit, vec2(to_unit(roll.x), to_unit(roll.y)));
    throughput *= PI * reflection_of(met.reflection, met.lit, onward, -direction);
    direction = onward;
    origin = ray_origin(met.position, met.lit);
  }
  return sum;
}

void main()
{
  out_diffuse = vec4(0.0);
  out_glossy = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  vec3 to_viewer = (film_view.eye.w > 0.5) ? film_view.backward.xyz : safe_normalize(film_view.eye.xyz - s.position);
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 31u));
  uvec3 roll = hash3(uvec3(uvec2(pixel), uint(film_view.sample_index * 1024 + 7)));
  vec3 origin = ray_origin(s.position, s.geometric_normal);
  if (max_component(s.diffuse) > 0.0) {
#ifdef SHARED
    out_diffuse.rgb = s.diffuse / PI * shared_irradiance_fetch(pixel + grid_offset).rgb;
#else
    float choice = scrambled(film_view.bits_w, salt.z);
    out_diffuse.rgb = virtual_gather(s, to_viewer, true, origin, choice, salt.x + roll.x);
#endif
    vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
    vec3 direction = cosine_direction(s.normal, u);
    if (dot(direction, s.geometric_normal) > 0.0) {
      float cosine = max(dot(direction, s.normal), 1e-6);
      vec3 weight = surface_diffuse_reflection(s, to_viewer, direction) * (PI / cosine);
      out_diffuse.rgb += weight * near_radiance(origin, direction, false, roll);
    }
  }
#ifdef GLOSSY
  if (s.kind <= FRESNEL_F82 && max_component(s.glossy_weight) > 0.0) {
    Lobe lobe = lobe_begin(s, to_viewer);
    // Where the lobe is most of what is seen, on metal, it has the noise that is seen.
    int count = (luminance(s.glossy_weight * s.glossy_tint) > luminance(s.diffuse)) ? lobe_rays : 1;
    vec2 u = vec2(scrambled(film_view.bits_z, salt.y), scrambled(film_view.bits_w, salt.x));
    for (int k = 0; k < count; k++) {
      float part = float(k) / float(count);
      vec3 weight;
      roll = hash3(roll);
      vec3 direction = lobe_sample(lobe, vec2(u.x / float(count) + part, fract(u.y + 2.5 * part)), weight);
      if (max_component(weight) > 0.0 && dot(direction, s.geometric_normal) > 0.0) {
        out_glossy.rgb += weight * near_radiance(origin, direction, true, roll) / float(count);
      }
    }
  }
#endif
#ifdef SOFT
  SoftLobe soft = soft_lobe_begin(s, to_viewer);
  if (soft.exists) {
    // Cloth shines at grazing angles, leaves are lit from behind: virtual lights, which stand for diffuse reflection on the
    // viewer's side, do not serve them. One ray does, of the cosine's density.
    float side = (soft.kind == LOBE_TRANSLUCENT) ? -1.0 : 1.0;
    roll = hash3(roll);
    vec2 u = vec2(scrambled(film_view.bits_z, salt.y), scrambled(film_view.bits_w, salt.x));
    vec3 direction = cosine_direction(side * soft.normal, u);
    if (side * dot(direction, s.geometric_normal) > 0.0) {
      vec3 weight = soft_reflection(soft, direction) * PI / max(side * dot(direction, soft.normal), 1e-6);
      vec3 start = ray_origin(s.position, side * s.geometric_normal);
      vec3 light = weight * near_radiance(start, direction, true, roll);
      if (soft.glossy) {
        out_glossy.rgb += light;
      }
      else {
        out_diffuse.rgb += light;
      }
    }
  }
#endif
}
