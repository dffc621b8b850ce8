// Candidates for virtual lights: points that light the picture, found from the picture. A pixel's cosine-distributed ray
// meets a surface. What that reflects of light straight from sources, and what comes to it from the next surface on a path
// of up to `bounces` reflections, are estimated apart: candidates share their next surfaces (indirect/pairs.frag.glsl).
#define SHEETS_FIND_SKY
#include "indirect/path.glsl"
#include "indirect/probe.glsl"

void main()
{
  out_point = vec4(0.0);
  out_normal = vec4(0.0);
  out_radiance = vec4(0.0);
  out_albedo = vec4(0.0);
  out_next_point = vec4(0.0);
  out_next_radiance = vec4(0.0);
  ivec2 place = ivec2(gl_FragCoord.xy);
  Probe probe = probe_read(place.y);
  if (!probe.receives) {
    return;
  }
  uint salt = uint(place.x) + probe.id * 977u;
  uvec3 bits = hash3(uvec3(salt, 23u, uint(film_view.seed)));
  // The probe's rays fill strata of the first number, and over the samples a net in both.
  vec2 u = vec2((float(place.x) + scrambled(film_view.bits_x, bits.x)) / float(rays), scrambled(film_view.bits_y, bits.y));
  vec3 direction = cosine_direction(probe.normal, u);
  if (dot(direction, probe.geometric_normal) <= 0.0) {
    return;
  }
  Vertex met;
  float t;
  uvec3 roll = hash3(uvec3(salt, uint(film_view.sample_index), uint(film_view.seed)));
  vec3 origin = ray_origin(probe.position, probe.geometric_normal);
  vec3 radiance = vec3(0.0);
  vec3 shorter = vec3(0.0);
  vec3 lobe = vec3(0.0);
  vec3 later = vec3(0.0);
  vec3 later_shorter = vec3(0.0);
  vec3 throughput = vec3(1.0);
  bool in_glass = false;    // of the last surface (Vertex)
  bool mirrored = false;    // the path goes on by a mirror
  bool from_glass = false;  // such that rays find lights
#ifdef GLASS_MIRRORS
  Vertex mirror;            // that glass
#endif
  // The first surface and the next ones by the same calls: compilers hold the code of each.
  int most = max(bounces, 1);
  for (int bounce = 1; (bounce <= most || from_glass) && max_component(throughput) > 1e-4; bounce++) {
    if (bounce > 1) {
      roll = hash3(roll);
      vec2 u = vec2(to_unit(roll.x), to_unit(roll.y));
      vec3 onward = cosine_direction(met.lit, u);
      vec3 reflected = PI * reflection_of(met.reflection, met.lit, onward, -direction);
      vec3 diffuse = even_share(met) * met.reflection.diffuse;
      // Neighbours share the next surfaces as the cosine finds them; those after follow the lobe.
      for (bool further = bounce > 2 && !mirrored; further; further = false) {
        onward = reflection_sample(met.reflection, met.lit, -direction, u, reflected);
      }
      reflected *= even_share(met);
#ifdef SMOOTH_MIRRORS
      for (; mirrored; mirrored = false) {
        onward = mirror_sample(met, -direction, u, reflected);
      }
#endif
      if (bounce == 2) {
        // What neighbours share is the part below albedo: rough surfaces reflect less than that to most directions.
        lobe = max(reflected - diffuse, vec3(0.0));
        out_albedo.rgb = min(reflected, diffuse);
      }
      else {
        // From here on paths end at random: what they bring is a mean over many, shared by many.
        throughput *= reflected;
        float chance = min(max_component(throughput), 1.0);
        if (to_unit(roll.z) >= chance) {
          break;
        }
        throughput /= chance;
      }
      direction = onward;
      in_glass = met.in_glass;
      origin = ray_origin(lit_position(met), met.lit);
    }
    bool meets = trace_vertex(origin, direction, 1e29, 0.0, in_glass, roll.z, met, t);
#ifdef GLASS_MIRRORS
    for (; from_glass; from_glass = false) {
      later += throughput * met.passed * mirrored_lights(mirror, origin, direction, meets ? t : 1e29, roll.y);
      later_shorter = (bounce <= bounces) ? later : later_shorter;
    }
#endif
    if (!meets || bounce > most) {
      break;
    }
    if (bounce > 1) {
      vec3 passing = met.passed * passing_media(origin, direction, t, roll.y);
      if (bounce == 2) {
        lobe *= passing;  // the rest where candidates share what they have met (choice_radiance.frag.glsl)
      }
      else {
        throughput *= passing;
      }
    }
    if (bounce == 1) {
      out_point = vec4(met.position, (dot(met.lit, met.normal) > 0.0) ? 1.0 : -1.0);  // 1: lit on the side that it lights
      out_normal = vec4(met.normal, 0.0);
      out_albedo = vec4(met.reflection.diffuse, 0.0);
    }
    else {
      if (bounce == 2) {
        out_next_point = vec4(met.position, (met.normal.z < 0.0) ? -1.0 : 1.0);
        out_normal.w = met.normal.x;
        out_next_radiance.w = met.normal.y;
      }
      roll = hash3(roll);
#ifdef MIRRORS_OWNED
      met.photons = false;  // they bring what a mirror sends to the picture, not to other surfaces
#endif
    }
#ifdef SMOOTH_MIRRORS
    // The roll after this one is the onward direction's.
    mirrored = bounce > 1 && mirror_drawn(met, -direction, to_unit(hash3(roll ^ uvec3(0x9E3779B9u)).x), true);
#endif
#ifdef GLASS_MIRRORS
#ifdef MIRRORS_DROPPED
    met.by_rays = 0.0;  // elsewhere rays of the picture's surfaces find the first one's (indirect/near.glsl)
#endif
    from_glass = mirrored && (met.within || met.by_rays > 0.0);
    mirror = met;
#endif
    vec3 sent = direct_reflected(met, -direction, (bounce == 1) ? 4 : 1, roll.x);
    if (bounce == 1) {
#ifdef SMOOTH_MIRRORS
      if (met.mirror_alpha >= 0.0) {
        // Rays of the picture's surfaces find what metal mirrors of other surfaces (indirect/near.glsl).
        met.reflection.straight = met.reflection.grazing = vec3(0.0);
        throughput *= (max_component(met.reflection.diffuse) > 0.0) ? 1.0 : 0.0;
      }
#endif
      radiance = sent;
      shorter = (bounces > 1) ? sent : vec3(0.0);
    }
    else {
      later += throughput * sent;
      later_shorter = (bounce < bounces) ? later : later_shorter;
    }
  }
  out_radiance = vec4(radiance + lobe * later, luminance(abs(shorter + lobe * later_shorter)));
  out_albedo.w = luminance(abs(later_shorter));
  out_next_radiance.rgb = later;
}
