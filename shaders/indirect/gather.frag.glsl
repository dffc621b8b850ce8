// Indirect light of this sample: virtual lights, bounded where they are near, and rays for what the bound leaves out
// (near.glsl). With SHARED, regions of pixels have gathered the virtual lights (region_gather.comp.glsl). Lobes up to
// `shaded_roughness` see what rays meet with its own materials (hits/).
#include "indirect/near.glsl"
#ifndef SHARED
#include "indirect/traced_gather.glsl"
#endif
#ifdef SOFT
#include "lib/soft_lobe.glsl"
#endif

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
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 7);
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
  if (s.kind <= FRESNEL_F82 && s.glossy_roughness > shaded_roughness && max_component(s.glossy_weight) > 0.0) {
    Lobe lobe = lobe_begin(s, to_viewer);
    // Where the lobe is most of what is seen, on metal, it has the noise that is seen.
    int count = (luminance(s.glossy_weight * s.glossy_tint) > luminance(s.diffuse)) ? lobe_rays : 1;
    // bits_w chose which lobe is kept: of each pixel it would draw a part of the lobe only.
    vec2 u = vec2(scrambled(film_view.bits_z, salt.y), shuffled(film_view.sample_index, salt.xz));
    for (int k = 0; k < count; k++) {
      float part = float(k) / float(count);
      vec3 weight;
      roll = hash3(roll);
      vec3 direction = lobe_sample(lobe, vec2(u.x / float(count) + part, fract(u.y + 2.5 * part)), weight);
      if (max_component(weight) > 0.0 && may_mirror(s, direction)) {
        origin = ray_origin(s.position, side_of_ray(s, direction));
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
    vec2 u = vec2(scrambled(film_view.bits_z, salt.y), shuffled(film_view.sample_index, salt.xz));
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
