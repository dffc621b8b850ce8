// Light rays through specular objects, one per texel: the stretches of each that lie in media after an interface.
//
// Rays of a lamp fill the cone around its casters evenly (a sun's, a disc across its direction). At smooth interfaces a ray
// is mirrored or bent at random, by Fresnel's reflectance; what is diffuse ends it. Two stretches are kept, each as its ends,
// its flux in watts, and half the distance to the next ray of all samples as it would be had nothing bent them; and by how
// much that grows on its way where a mirror that bulges, or the few that are mirrored by glass, send light apart.
// Leaves out links: in media and through glass light reaches every receiver.
#include "media/media.glsl"
#include "light/sources.glsl"
#include "trace/rays.glsl"
#include "trace/glass_color.glsl"

#define INTERFACES 10
// Rays that are mirrored at each of the first two interfaces of glass, at least, but a quarter of all at most.
#define MIRRORED_RAYS 1000.0
#define MIRRORED_SHARE 0.25
#define LEAST_BEAM 1e-3  // of light: where media have taken more, a beam that leaves the scene ends

// The part of a stretch that has media around it; false where none has. `even`: these media, as bits, where they are the
// same along all of it and their number has room in a float; 0: they must be asked for.
bool within_media(inout vec3 from, inout vec3 to, out uint even)
{
  even = 0u;
#ifdef MEDIA_WORLD
  return true;
#elif defined(MEDIA_BOUNDED)
  vec3 way = to - from;
  float reach = length(way);
  way /= max(reach, 1e-30);
  media_asked_by(MEDIA_OF_SHADOW);
  media_crossings(from, way);
  uint inside = media_at_start();
  float begin = reach;
  float end = 0.0;
  float at = 0.0;
  int parts = 0;
  for (int i = 0; i < media_intervals() && at < reach; i++) {
    float until = media_until(i, reach);
    parts += (inside != 0u && until > at) ? 1 : 0;
    even = (inside != 0u && until > at) ? inside : even;
    begin = (inside != 0u) ? min(begin, at) : begin;
    end = (inside != 0u) ? max(end, until) : end;
    inside = media_behind(i, inside);
    at = until;
  }
  even = (parts == 1 && even < (1u << 22u)) ? even : 0u;
  to = from + end * way;
  from += begin * way;
  return end > begin;
#else
  return false;
#endif
}

// By how much a mirror spreads light, for each unit of a beam's width: twice the curvature in the plane of incidence over
// the cosine, and times it across, in the mean. Of one that is hollow below zero, as it gathers light.
float mirrored_spread(ivec2 hit, vec3 position, vec3 normal, vec3 direction, float width)
{
  float cosine = max(-dot(normal, direction), 0.1);
  vec3 across = cross(normal, direction);
  float sine = length(across);
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  across = (sine > 1e-4) ? across / sine : tangent;
  vec3 along = cross(across, normal);
  float apart = max(width, 1e-6);
  vec3 here = triangle_shading_normal(hit, position);
  float side = (dot(here, normal) < 0.0) ? -1.0 : 1.0;
  float within = side * dot(triangle_shading_normal(hit, position + apart * along) - here, along) / apart;
  float beside = side * dot(triangle_shading_normal(hit, position + apart * across) - here, across) / apart;
  return within / cosine + beside * cosine;
}

void main()
{
  out_start0 = vec4(0.0);
  out_end0 = vec4(0.0);
  out_flux0 = vec4(0.0);
  out_start1 = vec4(0.0);
  out_end1 = vec4(0.0);
  out_flux1 = vec4(0.0);
  Light light = light_read(light_number);
  float rays = float(ray_side * ray_side);
  vec2 u = (floor(gl_FragCoord.xy) + beam_jitter) / float(ray_side);
  vec3 to_casters = casters.xyz - light.point;
  vec3 position = light.point;
  vec3 direction;
  vec3 flux;
  float spread;     // of neighbouring rays, as a tangent
  float width = 0.0;
  uint salt = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(film_view.sample_index) + 1024u * uint(film_view.seed))).x;
  if (LIGHT_IS(light, LIGHT_SUN)) {
    direction = -light.point;
    vec3 tangent;
    vec3 bitangent;
    orthonormal_basis(direction, tangent, bitangent);
    float radius = casters.w * sqrt(u.x);
    float turn = 2.0 * PI * u.y;
    position = casters.xyz - 2.0 * scene_size * direction + radius * (cos(turn) * tangent + sin(turn) * bitangent);
    float area = PI * casters.w * casters.w / rays;
    flux = light.radiance * ((light.radius > 0.0) ? light.area : 1.0) * area;
    width = 0.5 * sqrt(area);
    flux *= media_transmittance(position, light.point, FARTHEST_MEDIUM, 0u);  // upstream
    spread = 0.0;
  }
  else {
    bool is_round = LIGHT_IS(light, LIGHT_POINT) || LIGHT_IS(light, LIGHT_SPHERE);
    if (is_round) {
      position = light.centre + light.point;
      to_casters = casters.xyz - position;
    }
    float away = max(length(to_casters), 1e-20);
    float sine = min(casters.w / away, 1.0);
    float least = (casters.w >= away) ? -1.0 : sqrt(1.0 - sine * sine);
    vec3 axis = to_casters / away;
    vec3 tangent;
    vec3 bitangent;
    orthonormal_basis(axis, tangent, bitangent);
    float cosine = 1.0 - u.x * (1.0 - least);
    float across = sqrt(max(1.0 - cosine * cosine, 0.0));
    float turn = 2.0 * PI * u.y;
    direction = safe_normalize(cosine * axis + across * (cos(turn) * tangent + sin(turn) * bitangent));
    float solid_angle = 2.0 * PI * (1.0 - least) / rays;
    flux = light.radiance * solid_angle;
    if (light.radius > 0.0 || !is_round) {
      flux *= light.area;
    }
    if (!is_round) {
      float cos_light = dot(direction, light.axis);
      cos_light = (LIGHT_IS(light, LIGHT_SURFACE) && (light.flags & LIGHT_SIDED) == 0) ? abs(cos_light) : cos_light;
      flux *= (cos_light > 0.0) ? cos_light * spread_attenuation(light.spread, cos_light) : 0.0;
    }
    if ((light.flags & LIGHT_SPOT) != 0) {
      flux *= spot_attenuation(light, direction);
    }
    flux *= light_tree(light, direction, position, length(to_casters));
    spread = 0.5 * sqrt(solid_angle);
  }
  width *= closer;
  spread *= closer;
  uint seed = salt;
  uint choice = hash3(uvec3(uint(film_view.sample_index), uint(film_view.seed), 977u)).x;
  bool inside_glass = false;
  bool bent = false;
  int kept = 0;
  float travelled = 0.0;
  float apart = 1.0;   // how much farther from each other than rays of the grid those are that do the same
  float growth = 0.0;  // of the half width, by what has mirrored the ray
  for (int i = 0; i < INTERFACES; i++) {
    if (!(max_component(abs(flux)) > 0.0)) {  // lamps may have negative power
      return;
    }
    ivec2 hit;
    float t = trace_layers(position, direction, 1e29, 0.0, salt + uint(i), true, false, hit);
    bool missed = hit.x < 0;
    if (missed && !bent) {
      return;  // straight light is not this technique's
    }
    float reach = missed ? 4.0 * scene_size : t;
    int material = missed ? 0 : triangle_material(hit);
    vec4 kind = beam_table_fetch(ivec2(1, material));
    bool is_glass = !missed && kind.x > 0.5 && kind.x < 1.5;
    // Within a solid of glass none is seen; below a sheet of water, whose light never leaves it again, all of it.
    vec3 from = position;
    vec3 to = position + reach * direction;
    uint even;
    if (bent && !(inside_glass && is_glass) && kept < 2 && within_media(from, to, even)) {
      vec4 start = vec4(from, 1.0 + float(even));
      vec4 end = vec4(to, growth);
      vec4 carried = vec4(flux, (width + spread * travelled) * apart + growth * distance(from, position));
      if (kept == 0) {
        out_start0 = start;
        out_end0 = end;
        out_flux0 = carried;
      }
      else {
        out_start1 = start;
        out_end1 = end;
        out_flux1 = carried;
      }
      kept++;
    }
    if (missed) {
      return;
    }
    flux *= layers_color(t) * media_transmittance(position, direction, t, seed + uint(i));  // in glass, too: fog fills what stands in it
    travelled += t;
    position += t * direction;
    vec4 glass = beam_table_fetch(ivec2(0, material));
    vec3 normal = triangle_normal(hit);
    bool leaves = dot(normal, direction) > 0.0;
    vec3 smooth_normal = triangle_shading_normal(hit, position);
    smooth_normal = (dot(normal, smooth_normal) < 0.0) ? -smooth_normal : smooth_normal;
    vec3 facing = leaves ? -normal : normal;
    smooth_normal = leaves ? -smooth_normal : smooth_normal;
    smooth_normal = (dot(smooth_normal, direction) < 0.0) ? smooth_normal : facing;
    if (is_glass) {
      if (leaves) {
        flux *= exp(-min(kind.yzw * t, vec3(80.0)));
      }
      float ior = leaves ? 1.0 / glass.w : glass.w;
      float cosine = -dot(smooth_normal, direction);
      float reflectance = fresnel_dielectric(cosine, ior);
      // At the first two interfaces neighbours take numbers far apart, so that each share of them does what it should.
      vec2 lattice = (i == 0) ? vec2(0.7548777, 0.5698403) : vec2(0.8191725, 0.6710436);
      float turn = fract(dot(floor(gl_FragCoord.xy), lattice) + media_random(choice));
      // What is mirrored there goes to all sides, so that more rays than its share of light are: few would show as streaks.
      float share = (i < 2) ? max(reflectance, min(MIRRORED_RAYS / rays, MIRRORED_SHARE)) : reflectance;
      bool mirrored = ((i < 2) ? turn : media_random(seed)) < share;
      flux *= mirrored ? reflectance / share : (1.0 - reflectance) / max(1.0 - share, 1e-6);
      apart *= inversesqrt(max(mirrored ? share : 1.0 - share, 1e-4));
      if (mirrored) {
        float half_width = (width + spread * travelled) * apart;
        // What glass mirrors inside goes through a focus and spreads behind it, by less as it is bent before and after.
        float spreads = mirrored_spread(hit, position, smooth_normal, direction, half_width);
        growth += half_width * (leaves ? 0.5 * abs(spreads) : max(spreads, 0.0));
        direction = safe_normalize(direction + 2.0 * cosine * smooth_normal);
      }
      else {
        float eta = 1.0 / ior;
        float root = sqrt(max(1.0 - eta * eta * (1.0 - cosine * cosine), 0.0));
        direction = safe_normalize(eta * direction + (eta * cosine - root) * smooth_normal);
        flux *= glass_color(hit, position, glass.rgb, glass.w, 1.0, true) / (ior * ior);  // see caustics/photon.frag.glsl
        inside_glass = !leaves;
      }
      position = ray_origin(position, mirrored ? facing : -facing);
    }
    else if (kind.x > 1.5) {  // a mirror
      flux *= glass.rgb;
      float half_width = (width + spread * travelled) * apart;
      growth += half_width * max(mirrored_spread(hit, position, smooth_normal, direction, half_width), 0.0);
      direction = safe_normalize(direction - 2.0 * dot(direction, smooth_normal) * smooth_normal);
      position = ray_origin(position, facing);
    }
    else {
      return;
    }
    bent = true;
  }
}
