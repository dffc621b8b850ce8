// Indirect light of this sample that virtual lights leave to rays: near a surface what the bound leaves out, and what
// narrow lobes reflect (near.glsl). With SHARED also that of virtual lights, which regions of pixels have gathered
// (region_gather.comp.glsl). Lobes up to `shaded_roughness` see what rays meet with its own materials (hits/).
#include "ask/view.glsl"
#include "indirect/near.glsl"
#include "indirect/drawn_pixel.glsl"
#if defined(GLOSSY) || defined(SOFT)
#include "caustics/gloss.glsl"
#endif
#ifdef SOFT
#include "lib/soft_lobe.glsl"
#endif

void main()
{
  out_diffuse = vec4(0.0);
  out_glossy = vec4(0.0);
  ivec2 pixel;
  if (!drawn_pixel(pixel)) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  vec3 to_viewer = TO_VIEWER(s);
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 31u));
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 7);
  bool scatters = max_component(s.diffuse) > 0.0;
#ifdef SHARED
  out_diffuse.rgb = scatters ? s.diffuse / PI * shared_irradiance_fetch(pixel + grid_offset).rgb : vec3(0.0);
#endif
  int lobe_count = 0;
#ifdef GLOSSY
  Lobe lobe = lobe_begin(s, to_viewer);
  if (s.kind <= FRESNEL_F82 && s.glossy_roughness > shaded_roughness && max_component(s.glossy_weight) > 0.0) {
    // Where the lobe is most of what is seen, on metal, it has the noise that is seen.
    lobe_count = (luminance(s.glossy_weight * s.glossy_tint) > luminance(s.diffuse)) ? lobe_rays : 1;
  }
#endif
  int count = 1 + lobe_count;
#ifdef SOFT
  SoftLobe soft = soft_lobe_begin(s, to_viewer);
  count += soft.exists ? 1 : 0;
#endif
  // One call for the rays of all lobes: compilers hold the code of each call, and this one takes most of their time.
  for (int k = scatters ? 0 : 1; k < count; k++) {
    vec3 weight = vec3(0.0);
    vec3 direction = s.normal;
    vec3 side = s.geometric_normal;
    bool glossy = false;
    bool gloss_takes = false;
    bool soft_takes = false;
    bool onward = false;
    vec3 start = s.position;
    if (k == 0) {
      vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
      direction = cosine_direction(s.normal, u);
      if (dot(direction, s.geometric_normal) > 0.0) {
        weight = surface_diffuse_reflection(s, to_viewer, direction) * (PI / max(dot(direction, s.normal), 1e-6));
      }
    }
    else {
      roll = hash3(roll);
      // bits_w chose which lobe is kept: of each pixel it would draw a part of the lobe only.
      vec2 u = vec2(scrambled(film_view.bits_z, salt.y), shuffled(film_view.sample_index, salt.xz));
#ifdef GLOSSY
      if (k <= lobe_count) {
        float part = float(k - 1) / float(lobe_count);
        direction = lobe_sample(lobe, vec2(u.x / float(lobe_count) + part, fract(u.y + 2.5 * part)), weight);
        weight = may_mirror(s, direction) ? weight / float(lobe_count) : vec3(0.0);
        side = side_of_ray(s, direction);
        glossy = true;
        gloss_takes = (photons_shine & PHOTONS_ON_GLOSS) != 0 && gloss_takes_photons(s);
      }
#endif
#ifdef SOFT
      if (k > lobe_count) {
        // Cloth shines at grazing angles, leaves are lit from behind: virtual lights, which stand for diffuse reflection on
        // the viewer's side, do not serve them. One ray does, of the cosine's density.
        float turn = (soft.kind == LOBE_TRANSLUCENT) ? -1.0 : 1.0;
        direction = cosine_direction(turn * soft.normal, u);
        side *= turn;
        glossy = soft.glossy;
        soft_takes = (photons_shine & PHOTONS_ON_SOFT) != 0 && !soft.fibre;
        if (soft.fibre) {
          direction = fibre_sample(soft, vec4(to_unit(roll.x), to_unit(roll.y), u), weight);
          start = fibre_start(soft, s.position, direction, side);
          onward = true;
        }
        else if (dot(direction, side) > 0.0) {
          weight = soft_reflection(soft, direction) * PI / max(turn * dot(direction, soft.normal), 1e-6);
        }
      }
#endif
    }
    if (max_component(weight) > 0.0) {
      vec3 light = weight * near_radiance(ray_origin(start, side), direction, k > 0, onward, gloss_takes, soft_takes, roll);
      if (glossy) {
        out_glossy.rgb += light;
      }
      else {
        out_diffuse.rgb += light;
      }
    }
  }
}
