// What does not depend on lights: emission, the visible world, colours and normals of this sample. NOT_DRAWN: outputs
// that this picture does not hold, declared; SUM_ALL: the sum of light that is not held apart (film/together.py).
// Leaves out media: an image of what they let pass along the view dims what is collected (media/view.frag.glsl).
// Leaves out links: the camera sees lamps whatever they light.
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#ifdef SOFT_LOBES
#include "lib/soft_lobe.glsl"
#endif
#include "lib/environment.glsl"
#include "ask/view.glsl"
#include "light/sources.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  Surface s = SURFACE_READ(pixel);
  NOT_DRAWN
  out_emission = vec4(0.0);
  out_environment = vec4(0.0);
  out_diffuse_color = vec4(vec3(0.0), mist.w);
  out_glossy_color = vec4(0.0);
  out_transmission_color = vec4(0.0);
  out_normal = vec4(0.0);
  vec3 direction = view_direction(gl_FragCoord.xy);
  vec3 origin = view_origin(gl_FragCoord.xy);
  float limit = 1e30;
  float coverage = 0.0;
  if (s.hit) {
    coverage = 1.0 - s.holdout;
    limit = dot(s.position - origin, direction);
    direction = view_is_baked() ? -TO_VIEWER(s) : direction;
    out_emission.rgb = s.emission;
    out_diffuse_color.rgb = s.diffuse;
    out_normal = vec4(s.normal, 1.0);
    if (mist.w > 0.0) {
      float share = clamp((view_distance(s.position) - mist.x) * mist.y, 0.0, 1.0);
      // Exact for the powers that Blender has: that of a card is good to five digits.
      out_diffuse_color.a = (mist.z == 2.0) ? share * share : (mist.z == 0.5) ? sqrt(share) : pow(share, mist.z);
    }
    bool microfacets = max_component(s.glossy_weight) > 0.0;
#ifdef SOFT_LOBES
    SoftLobe soft = soft_lobe_begin(s, -direction);
    if (soft.exists) {
      out_diffuse_color.rgb += soft.glossy ? vec3(0.0) : soft.weight;
      out_glossy_color.rgb = soft.glossy ? soft.weight : vec3(0.0);
      microfacets = false;
    }
#endif
#ifdef GLOSSY
    if (microfacets && s.kind == LOBE_REFRACTION) {
      float mu = max(dot(s.glossy_normal, -direction), 0.0);
      vec3 share = vec3(1.0);
      if (s.glossy_edge.x > 0.5) {
        share = glass_passing(s.glossy_tint, mu, s.glossy_roughness, s.glossy_ior);
      }
      out_transmission_color.rgb = s.glossy_weight * share;
      microfacets = surface_goes_both_ways(s);
      s = surface_mirrored(s);
    }
    if (microfacets) {
      float mu = max(dot(s.glossy_normal, -direction), 0.0);
      float roughness = lobe_roughness(lobe_alpha(s.glossy_roughness, s.glossy_anisotropy));
      out_glossy_color.rgb = s.glossy_weight *
                             glossy_albedo(s.kind, s.glossy_tint, s.glossy_edge, s.glossy_ior, roughness, mu);
      if (s.distribution != DISTRIBUTION_MULTI_GGX) {
        // As Cycles has it: the share that is lost is in the light, not in the colour.
        out_glossy_color.rgb /= max(ggx_energy(mu, roughness), 1e-4);
      }
    }
#endif
#ifdef GLOSSY
    if (s.coated) {
      Surface coat = surface_coat(s);
      out_glossy_color.rgb += coat.glossy_weight *
                              glossy_albedo(coat.kind, coat.glossy_tint, coat.glossy_edge, coat.glossy_ior, coat.glossy_roughness,
                                            max(dot(coat.glossy_normal, -direction), 0.0));
    }
#endif
    if (max_component(s.diffuse) <= 0.0 && max_component(s.glossy_weight) > 0.0) {
      out_normal.xyz = s.glossy_normal;
    }
  }
  else if (view_sees(gl_FragCoord.xy)) {
#ifdef WORLD
    out_environment.rgb = (world_light.color.w > 0.5) ? environment_radiance(direction) * s.emission : vec3(0.0);
#endif
    // What layers take away covers, too.
    coverage = 1.0 - world_light.map_options.x * dot(s.emission, vec3(1.0 / 3.0));
  }
  else {
    coverage = 1.0;  // beside a fisheye's circle Cycles has black, which is no hole in a transparent film either
  }
  out_environment.a = coverage;
#if LIGHT_KINDS != 0
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    if ((light.flags & LIGHT_CAMERA) != 0) {
      float hit_distance;
      float density;
      vec3 radiance = light_hit(light, origin, direction, hit_distance, density);
      if (hit_distance < limit) {
        // Where there is no surface, its emission is what coloured layers let through.
        out_emission.rgb += s.hit ? radiance : radiance * s.emission;
      }
    }
  }
#endif
  SUM_ALL
}
