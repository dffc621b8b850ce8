// Light that surfaces send on: where rays meet them, what they reflect, and what light reaches them straight from sources.
//
// A program that includes this binds the surface images, `film_view`, `sources`, the hierarchy and `reflectance`, and has
// the constants `light_count` and `offset_size`.
// Leaves out links: light that comes by way of surfaces reaches every receiver.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/brdf.glsl"
#include "light/sources.glsl"
#include "trace/rays.glsl"
#include "indirect/albedo.glsl"
#include "indirect/mirror_color.glsl"
#include "ask/media.glsl"
#include "ask/leaving.glsl"
#include "light/close_by.glsl"

#if defined(GLASS_SHEETS) && !defined(GLASS_MIRRORS)
#define GLASS_MIRRORS  // sheets of glass mirror from within
#endif
#if defined(GLASS_MIRRORS) && !defined(SMOOTH_MIRRORS)
#define SMOOTH_MIRRORS 0.0  // up to this alpha
#endif
#define MOST_MIRRORED 4.0    // of lamps' light along one ray, over what even light has in the mean
#define WIDE 0.05            // solid angle of a light, sr, from which on rays that glass mirrors find it without grain
#define LAYERS_PASSED 16     // surfaces that a ray to a light goes through that they do not block

struct Vertex {
  vec3 position;
  vec3 normal;  // of the triangle, on the side that the ray came from, to which it sends light
  vec3 lit;     // the same, or on the other side: that from which light reaches it
  // That, as normal maps and bumps turn it: light straight from sources is reflected by it. Of a mean over bumps the length
  // is what is left of the normals' length, and `upright` the mean cosine between them and the surface's.
  vec3 turned;
  float upright;
  Reflection reflection;
  vec3 passed;   // colours of layers before it
  vec3 leaving;  // radiance of direct light that entered elsewhere
  vec3 straight; // of the diffuse albedo, what direct light is reflected by here
  bool in_glass; // `leaving` and `reflection` count what glass around mirrors back of what is sent
#ifdef HIT_LINKS
  int group;    // of receivers (addon/snapshot/linking.py)
#endif
#ifdef MIRRORS_OWNED
  bool photons;  // lamps' light that it mirrors arrives as photons of caustics
  float others;  // share of what it mirrors of lights that photons do not answer for: virtual lights send the rest
  bool glass;
#endif
#ifdef SMOOTH_MIRRORS
  // Of smooth metal: the lobe's own alpha (that of `reflection` is wider), below 0 elsewhere; the interpolated normal; and
  // what of the lobe in `reflection` is its own.
  float mirror_alpha;
  vec3 mirror_normal;
  vec3 mirror_share;
#endif
#ifdef GLASS_MIRRORS
  bool within;     // a sheet of glass from within
  float by_rays;   // share of what it mirrors of lamps that rays find (found_by_rays); 0 where none look for them
#endif
};

// Pixel of the picture in which a point of a surface lies that faces the camera; false if there is none. What the pixel
// shows is this point if it is nearer than `footprint`, m; `slant` is the cosine between its normal and the viewer.
bool pixel_of(vec3 position, vec3 normal, out ivec2 pixel, out float slant, out float footprint)
{
  pixel = ivec2(0);
  slant = footprint = 0.0;
  vec2 share;
  if (!view_place(position, share)) {
    return false;
  }
  vec2 size = vec2(surface_position_size());
  vec2 place = share * size;
  if (any(lessThan(place, vec2(0.0))) || any(greaterThanEqual(place, size))) {
    return false;
  }
  pixel = ivec2(place);
  vec3 to_eye = view_toward(position);
  slant = max(dot(normal, to_eye), 0.0);
  // The pixel's own point lies within its footprint, stretched where the surface is seen from the side.
  footprint = 1.5 * view_pixel() * view_growth_ahead(position) / max(slant, 0.1);
  return slant > 0.0;
}

// Mean reflectance of the material of a triangle that a ray has met.
vec3 mean_albedo(ivec2 hit)
{
  int material = triangle_material(hit);
  return reflectance_fetch(ivec2(material & 15, material >> 4)).rgb;
}

// The same as a diffuse part and a lobe.
Reflection mean_reflection(ivec2 hit)
{
  int material = triangle_material(hit);
  ivec2 place = ivec2(material & 15, material >> 4);
  int rows = reflectance_rows();
  vec4 straight = reflectance_fetch(place + ivec2(0, 2 * rows));
  Reflection mean;
  vec4 diffuse = reflectance_fetch(place + ivec2(0, rows));
  mean.diffuse = diffuse.rgb;
  mean.through = reflectance_fetch(place + ivec2(0, 8 * rows)).rgb / max(diffuse.rgb, vec3(1e-30));
  mean.straight = straight.rgb;
  vec4 grazing = reflectance_fetch(place + ivec2(0, 3 * rows));
  mean.grazing = grazing.rgb;
  mean.rough = grazing.a;
  mean.alpha = straight.a;
  return mean;
}

#ifdef TURNED_NORMALS
// The normal of a triangle as the material of that turns it in the mean, on faces that look alike; see Vertex.
vec3 mean_turned(ivec2 hit, vec3 normal, out float upright)
{
  int material = triangle_material(hit);
  int rows = reflectance_rows();
  ivec2 place = ivec2(material & 15, (material >> 4) + 4 * rows);
  vec4 x = reflectance_fetch(place);
  vec4 y = reflectance_fetch(place + ivec2(0, rows));
  vec4 z = reflectance_fetch(place + ivec2(0, 2 * rows));
  vec3 mixed = reflectance_fetch(place + ivec2(0, 3 * rows)).xyz;
  vec3 moved = vec3(dot(x.xyz, normal), dot(y.xyz, normal), dot(z.xyz, normal));
  float alike = dot(vec3(x.w, y.w, z.w), normal * normal) + 2.0 * dot(mixed, normal.yzx * normal.zxy);
  upright = clamp(1.0 + x.x + y.y + z.z, 0.05, 1.0);
  return (alike > 1e-3) ? normal + moved / alike : normal;
}
#endif

// What a point reflects: exactly where the camera sees it, else the mean of its material. Of glass the mean, too: that is
// over the chance that rays do not pass, which the camera's surface is not.
Reflection reflection_at(ivec2 hit, vec3 position, vec3 normal, out vec3 turned, out float upright)
{
  turned = normal;
  upright = 1.0;
  ivec2 pixel;
  float slant;
  float footprint;
  if (pixel_of(position, normal, pixel, slant, footprint)) {
    vec4 seen = surface_position_fetch(pixel);
    if (seen.w != 0.0 && distance(seen.xyz, position) < footprint) {
      Surface s = SURFACE_READ(pixel);
      bool clear = (s.kind == LOBE_REFRACTION || surface_is_mirror_of_glass(s)) && max_component(s.diffuse) <= 0.0;
      // Of a holdout the picture has cut out what it reflects.
      if (s.holdout < 1.0 && dot(s.geometric_normal, normal) > 0.9 && !clear) {
#ifdef TURNED_NORMALS
        turned = (s.bump > 0.0) ? s.normal : normal;
        upright = (s.bump > 0.0) ? max(dot(s.normal, normal), 0.05) : 1.0;
#endif
        return surface_reflection(s, slant);
      }
    }
  }
#ifdef TURNED_NORMALS
  turned = mean_turned(hit, normal, upright);
#endif
  return mean_reflection(hit);
}

#ifdef SMOOTH_MIRRORS
// Whether what a ray meets may mirror it: smooth metal, or a sheet of glass from within.
bool may_be_mirror(ivec2 hit, vec3 position, vec3 direction)
{
  int material = triangle_material(hit);
  ivec2 place = ivec2(material & 15, material >> 4);
  int rows = reflectance_rows();
  float code = reflectance_fetch(place).a;
  bool metal = code > 0.5;
  for (bool unsure = metal; unsure; unsure = false) {
    metal = reflectance_fetch(place + ivec2(0, rows)).a <= SMOOTH_MIRRORS * code
            && max_component(reflectance_fetch(place + ivec2(0, 3 * rows)).rgb) > 0.0;
  }
#ifdef GLASS_SHEETS
  return metal || leaves_sheet(hit, position, direction);
#else
  return metal;
#endif
}

#ifdef GLASS_SHEETS
// What a sheet of glass mirrors of a ray from within that meets it at this cosine, over the share of even light that it stops.
float sheet_mirrors(ivec2 hit, float cosine)
{
  float sides = mod(-leaf_texel(hit.x * LEAF_TEXELS + OPACITY_TEXEL)[HIT_SLOT(hit)], SIDES * SIDES);
  vec2 passing = vec2(1.0) - vec2(floor(sides / SIDES), mod(sides, SIDES)) / (SIDES - 1.0);
  float leaving = min(passing.x, passing.y);  // over n2 as many directions
  float ior = sqrt(leaving / max(max(passing.x, passing.y), 1e-3));
  return fresnel_dielectric(cosine, ior) / max(1.0 - leaving, 1e-3);
}

#endif

#ifdef GLASS_MIRRORS
// Radiance of the world's wide light: that which does not arrive as photons.
vec3 wide_sky(vec3 direction)
{
  float azimuth = (direction.x == 0.0 && direction.y == 0.0) ? 0.0 : atan(direction.y, direction.x);
  ivec2 cell = ivec2(vec2(0.5 + azimuth / (2.0 * PI), 0.5 + 0.5 * direction.z) * vec2(SKY_COLUMNS, SKY_ROWS));
  cell = clamp(cell, ivec2(0), ivec2(SKY_COLUMNS, SKY_ROWS) - 1);
  return reflectance_fetch(ivec2(cell.x, reflectance_size().y - SKY_ROWS + cell.y)).rgb;
}
#endif

// Whether a ray that meets this has met smooth metal, and how it mirrors.
void mirror_met(inout Vertex met, ivec2 hit, vec3 direction)
{
  int material = triangle_material(hit);
  float code = reflectance_fetch(ivec2(material & 15, material >> 4)).a;
  bool is_mirror = code > 0.5 && max_component(met.reflection.grazing) > 0.0;
  met.mirror_alpha = -1.0;
  met.mirror_normal = met.normal;
  met.mirror_share = vec3(0.0);
#ifdef GLASS_MIRRORS
  met.within = false;
  met.by_rays = 0.0;
#endif
#ifdef GLASS_SHEETS
  // From below a sheet of water rays pass with the chance that even light from there leaves it. What it mirrors of those that
  // it stops goes by Fresnel's reflectance: most by total reflection.
  met.within = leaves_sheet(hit, met.position, direction);
  for (bool within = met.within; within; within = is_mirror = false) {
    met.reflection.diffuse = vec3(0.0);
    met.reflection.straight = met.reflection.grazing = vec3(1.0);
    met.mirror_share = vec3(sheet_mirrors(hit, dot(direction, met.normal)));
    met.mirror_alpha = 0.0;
  }
#endif
  // A loop, since a rasteriser in software skips loops that no pixel enters, but no branches.
  for (; is_mirror; is_mirror = false) {
    ivec2 place = ivec2(material & 15, (material >> 4) + reflectance_rows());
    float alpha = reflectance_fetch(place).a / code;
    met.mirror_alpha = (alpha <= SMOOTH_MIRRORS) ? alpha : -1.0;
    met.mirror_share = mirror_scale(material);
    vec3 smooth_normal = triangle_shading_normal(hit, met.position);
    smooth_normal = (dot(smooth_normal, met.normal) < 0.0) ? -smooth_normal : smooth_normal;
    met.mirror_normal = (dot(smooth_normal, direction) < 0.0) ? smooth_normal : met.normal;
#ifdef GLASS_MIRRORS
    // Glass stops rays with the chance of about Fresnel's reflectance at their angle (stopped_by_angle), that with a tile of
    // its mean over even light, and mirrors those by that reflectance over the chance. Beside other closures no mirror is
    // known apart.
    float ior = reflectance_fetch(place + ivec2(0, 6 * reflectance_rows())).a;
    for (bool glass = triangle_is_glass(hit); glass; glass = false) {
      if (ior <= 0.0 || max_component(met.reflection.diffuse) > 0.0) {
        met.mirror_alpha = -1.0;
        break;
      }
      ior = max(ior, 1.0 / ior);
      float cosine = -dot(met.mirror_normal, direction);
      float mean = fresnel_average_dielectric(ior);
      float even = mean;
      float stopped = glass_stops(hit, abs(dot(met.normal, direction)), even);
      // The material's means are over the chance that it has at their view.
      float at_view = fresnel_dielectric(MEAN_COSINE, ior);
      float chance = 1.0 - (1.0 - even) * (1.0 - at_view) / (1.0 - mean);
      float mirrored = fresnel_dielectric(cosine, ior) / max(stopped, 1e-6) * chance / max(at_view, 1e-6);
      vec3 albedo = reflectance_fetch(ivec2(material & 15, material >> 4)).rgb;
      met.reflection.straight = met.reflection.grazing = albedo * mirrored;
      met.mirror_share = vec3(1.0);
      // Where few rays would bring much each the lobe sends what is more than MOST_MIRRORED of even light.
      met.by_rays = min(MOST_MIRRORED / max(mirrored, 1e-6), 1.0);
    }
#endif
  }
}

// What smooth metal reflects of what comes from where it mirrors `viewer`.
vec3 mirror_reflectance(Vertex met, float cosine)
{
  float rise = pow(clamp(1.0 - cosine, 0.0, 1.0), 5.0);
  return met.mirror_share * mix(met.reflection.straight, met.reflection.grazing, rise);
}

// Where smooth metal mirrors a `viewer`; `weight`: what it reflects of light from there.
vec3 mirror_sample(Vertex met, vec3 viewer, vec2 u, out vec3 weight)
{
  vec3 tangent;
  vec3 bitangent;
  vec2 alpha = vec2(met.mirror_alpha);
  orthonormal_basis(met.mirror_normal, tangent, bitangent);
  vec3 view = vec3(dot(tangent, viewer), dot(bitangent, viewer), max(dot(met.mirror_normal, viewer), 1e-4));
  vec3 facet = (met.mirror_alpha > 1e-4) ? visible_normal(view, alpha, u) : vec3(0.0, 0.0, 1.0);
  facet = facet.x * tangent + facet.y * bitangent + facet.z * met.mirror_normal;
  weight = mirror_reflectance(met, dot(viewer, facet));
  vec3 direction = safe_normalize(2.0 * dot(viewer, facet) * facet - viewer);
  weight = (dot(direction, met.normal) > 0.0) ? weight : vec3(0.0);
  return direction;
}

// Whether a path goes on by the mirror of what it has met, drawn by how much of what that reflects the mirror has. What
// remains of its reflection is the way drawn, over the chance of that. Where MIRRORS_DROPPED is defined, light does not go
// by mirrors to rough surfaces (`to_rough`).
bool mirror_drawn(inout Vertex met, vec3 viewer, float u, bool to_rough)
{
  if (met.mirror_alpha < 0.0) {
    return false;
  }
  float mirrored = luminance(mirror_reflectance(met, dot(met.mirror_normal, viewer)));
  float chance = mirrored / max(mirrored + luminance(met.reflection.diffuse), 1e-30);
#ifdef MIRRORS_DROPPED
  chance = to_rough ? 0.0 : chance;
#endif
  bool drawn = u < chance;
  float scale = 1.0 / max(drawn ? chance : 1.0 - chance, 1e-6);
  met.reflection.diffuse *= drawn ? 0.0 : scale;
  met.reflection.straight *= drawn ? scale : 0.0;
  met.reflection.grazing *= drawn ? scale : 0.0;
#ifdef GLASS_MIRRORS
  met.by_rays = drawn ? met.by_rays : 0.0;
#endif
  return drawn;
}
#endif

// The surface that a ray meets before `limit`, or the mirror that it meets before `mirror_limit`, if that is farther;
// false if none. `in_glass`: of where the ray begins (Vertex); what glass around that mirrors is then none.
bool trace_vertex(vec3 origin, vec3 direction, float limit, float mirror_limit, bool in_glass, uint salt, out Vertex met,
                  out float t)
{
  ivec2 hit;
#ifdef SMOOTH_MIRRORS
  float most = max(limit, mirror_limit);
#else
  float most = limit;
#endif
  t = trace_nearest(origin, direction, most, salt, hit);
  met.passed = layers_color(t);
  if (t >= most) {
    return false;
  }
  met.position = origin + t * direction;
#ifdef SMOOTH_MIRRORS
  if (t >= limit && !may_be_mirror(hit, met.position, direction)) {
    return false;
  }
#endif
  if (in_glass && triangle_is_glass(hit) && !triangle_is_sheet(hit)
      && dot(triangle_shading_normal(hit, met.position), direction) > 0.0) {
    return false;
  }
  met.normal = triangle_normal(hit);
  if (dot(met.normal, direction) > 0.0) {
    met.normal = -met.normal;
  }
  met.reflection = reflection_at(hit, met.position, met.normal, met.turned, met.upright);
#ifdef HIT_LINKS
  met.group = triangle_links(hit).x;
#endif
#ifdef MIRRORS_OWNED
  int material = triangle_material(hit);
  met.photons = reflectance_fetch(ivec2(material & 15, material >> 4)).a > 0.5;
  met.others = 1.0;
  met.glass = triangle_is_glass(hit);
#endif
#ifdef SMOOTH_MIRRORS
  mirror_met(met, hit, direction);
#endif
  vec3 part;
  vec3 same;
  met.leaving = vec3(0.0);
  met.straight = vec3(1.0);
  if (light_leaves(triangle_material(hit), met.position, met.normal, -direction, salt, met.leaving, part, same, met.in_glass)) {
    vec3 onward = vec3(1.0) - part * (vec3(1.0) - same);
    met.leaving *= part * met.reflection.diffuse;
    met.straight = (vec3(1.0) - part) / max(onward, vec3(1e-6));
    met.reflection.diffuse *= onward;
  }
  met.lit = met.normal;
#ifndef MATT
  if (max_component(met.reflection.through) > 0.0) {
    bool passes = reflects_far_side(met.reflection, to_unit(hash3(uvec3(salt, uint(hit.x), uint(hit.y))).x));
    met.lit = passes ? -met.normal : met.normal;
    met.turned = passes ? -met.turned : met.turned;
  }
#endif
  return true;
}

// Where light reaches what a ray has met: on the far side of a strand of hair that it shines through.
vec3 lit_position(Vertex met)
{
  float thick = (dot(met.lit, met.normal) < 0.0) ? max(-met.reflection.rough, 0.0) : 0.0;
  return met.position - thick * met.normal;
}

// What media let pass of light that comes along a ray from `limit`.
vec3 passing_media(vec3 origin, vec3 direction, float limit, uint salt)
{
  return media_transmittance(origin, direction, min(limit, FARTHEST_MEDIUM), salt);
}

// Whether the entry that has just raised the `total` to what it is takes the place of the one drawn so far, such that of
// all that have passed each stays in proportion to its share (Chao 1982). `roll` is another random number for each entry:
// one number stretched over all of them would run out of digits where shares differ by powers of ten.
bool draw_passing(float share, float total, inout uint roll)
{
  roll = roll * 747796405u + 2891336453u;
  uint word = ((roll >> ((roll >> 28u) + 4u)) ^ roll) * 277803737u;
  float u = (float(((word >> 22u) ^ word) >> 9u) + 0.5) * (1.0 / 8388608.0);
  return u * total < share;
}

// Irradiance by one source if nothing blocks it.
vec3 unblocked_irradiance(Light light, vec3 position, vec3 normal, out vec3 direction)
{
  float density;
  vec3 arriving = light_sample(light, position, direction, density);
  return ((light.flags & LIGHT_DIFFUSE) != 0) ? arriving * max(dot(normal, direction), 0.0) : vec3(0.0);
}

// How far a ray along `direction` may go before it meets this sample's point of a light. Points that have a place are
// aimed at anew: from the ray's origin, which is beside the surface, it would meet an emissive triangle a little too soon.
float light_reach(Light light, vec3 origin, inout vec3 direction)
{
  bool has_point = (light.flags & LIGHT_NARROW) == 0;
  if ((has_point && (light.kind == LIGHT_RECTANGLE || light.kind == LIGHT_ELLIPSE)) || light.kind == LIGHT_SURFACE) {
    vec3 path = light.point - origin;
    float reach = max(length(path), 1e-30);
    direction = path / reach;
    return reach * 0.9999;
  }
  return light_distance(light, origin, direction);
}

// What surfaces let pass of this sample's point of a light that is seen along `direction`.
vec3 light_passing(Light light, vec3 origin, vec3 direction, uint salt)
{
  float reach = light_reach(light, origin, direction);
  ivec2 hit;
#ifdef HIT_LINKS
  if (light.first_view != 0) {
    // Groups of blockers that let its light pass: the ray goes on behind what belongs to them.
    vec3 passed = vec3(1.0);
    for (int i = 0; i < LAYERS_PASSED; i++) {
      float t = trace_layers(origin, direction, reach, 0.0, salt, false, true, hit);
      passed *= layers_color(t);
      if (t >= reach) {
        return passed;
      }
      if (((light.first_view >> triangle_links(hit).y) & 1) == 0) {
        return vec3(0.0);
      }
      vec3 normal = triangle_normal(hit);
      origin = ray_origin(origin + t * direction, (dot(normal, direction) < 0.0) ? -normal : normal);
      reach = max(reach - t, 0.0);
      if (light.kind == LIGHT_RECTANGLE || light.kind == LIGHT_ELLIPSE || light.kind == LIGHT_SURFACE) {
        reach = light_reach(light, origin, direction);
      }
    }
    return vec3(0.0);
  }
#endif
  return (trace_shadow(origin, direction, reach, salt, hit) >= reach) ? layers_color(reach) : vec3(0.0);
}

// How much of even light from all sides bumps leave to be reflected: what they turn away from, and what they shadow
// (bump_shadowing of lib/brdf.glsl, integrated numerically; within .012 up to 70 degrees).
float even_share(Vertex met)
{
  return 1.0 - 0.87 * (1.0 - met.upright);
}

#if defined(LIT_BY_MAPS) && defined(MIRRORS_OWNED)
// Where a walk begins at what a ray of a lobe has met: photons come there by maps of what lights see (caustics/at_hits.frag.glsl).
vec3 mapped_position;
vec3 mapped_normal;

// Whether this light's map may show that place: one that faces away from the light is in none.
bool light_maps(Light light)
{
  vec3 direction;
  float density;
  light_sample(light, mapped_position, direction, density);
  return dot(direction, mapped_normal) > 0.0;
}
#endif

#ifdef GLASS_MIRRORS
// Whether rays from here that glass mirrors find this light in place of the glass's lobe: where no photons bring it and it
// is wide, or the world's.
bool found_by_rays(Light light, vec3 position)
{
#ifdef MIRRORS_OWNED
  bool answered = (light.flags & LIGHT_GLASS_BLOCKS) != 0;
#else
  bool answered = false;
#endif
  if (answered || (!LIGHT_IS(light, LIGHT_DIRECTION) && ((light.flags & LIGHT_SHADOW) == 0 || light.first_view != 0))) {
    return false;
  }
  vec3 away = light.centre - position;
  float squared = dot(away, away);
  bool flat_area = LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE);
  bool ball = LIGHT_IS(light, LIGHT_SPHERE) || LIGHT_IS(light, LIGHT_POINT);
  return LIGHT_IS(light, LIGHT_DIRECTION) || (LIGHT_IS(light, LIGHT_SUN) && light.area > WIDE)
         || (flat_area && light.area > WIDE * squared) || (ball && PI * light.radius * light.radius > WIDE * squared);
}

// Radiance along a ray that glass has mirrored from lamps nearer than the next surface, at `limit`, and where there is none
// of the world's wide light. `mirror`: the glass.
vec3 mirrored_lights(Vertex mirror, vec3 origin, vec3 direction, float limit, uint salt)
{
  vec3 sum = vec3(0.0);
  if (limit >= 1e29) {
    sum = wide_sky(direction) * passing_media(origin, direction, FARTHEST_MEDIUM, salt);
  }
  for (int i = 0; i < light_count && mirror.by_rays > 0.0; i++) {
#ifdef HIT_LINKS
    if (((int(sources.light[i * LIGHT_TEXELS].x) >> 4 >> mirror.group) & 1) != 0) {
      continue;
    }
#endif
    Light light = light_read(i);
    float hit_distance;
    float density;
    vec3 radiance = light_hit(light, origin, direction, hit_distance, density);
    if (max_component(radiance) > 0.0 && hit_distance < limit && found_by_rays(light, mirror.position)) {
      sum += radiance * mirror.by_rays * passing_media(origin, direction, hit_distance, salt);
    }
  }
  return sum;
}
#endif

// What reflects light straight from this source: not the lobe where photons bring what that mirrors, nor, where rays that a
// sheet of glass mirrors find the world (SHEETS_FIND_SKY), of that what wide_sky has.
Reflection straight_reflection(Vertex met, Light light)
{
  Reflection reflection = met.reflection;
  reflection.diffuse *= met.straight;
#ifdef MIRRORS_OWNED
  bool answered = (light.flags & LIGHT_GLASS_BLOCKS) != 0;
  bool brought = answered && met.photons;
#ifdef LIT_BY_MAPS
  brought = brought && light_maps(light);
#endif
  float mirrored = !answered ? met.others : brought ? 0.0 : 1.0;
  reflection.straight *= mirrored;
  reflection.grazing *= mirrored;
#endif
#if defined(GLASS_MIRRORS) && defined(SHEETS_FIND_SKY)
  bool of_world = LIGHT_IS(light, LIGHT_DIRECTION);
  bool found = met.within && of_world && (light.flags & LIGHT_GLASS_BLOCKS) == 0;
  found = found || (met.by_rays > 0.0 && found_by_rays(light, met.position));
  float left = !found ? 1.0 : of_world ? 0.0 : 1.0 - met.by_rays;
  reflection.straight *= left;
  reflection.grazing *= left;
#endif
  return reflection;
}

// What emissive triangles close to a place bring that their points leave out (light/close_by.glsl), along a cosine-distributed
// ray. `light`: one of this sample's points, of which all share what they are drawn by. Returns irradiance over PI, from where
// the ray comes.
vec3 emission_close_by(Light light, vec3 origin, vec3 normal, bool glass_stops, uint salt, out vec3 direction)
{
  uvec3 bits = hash3(uvec3(salt, 61u, 7u));
  direction = cosine_direction(normal, vec2(to_unit(bits.x), to_unit(bits.y)));
  float level = light_edge(light);
  float spread = light_least(light) * emissive_density(light.radiance, level);  // the same of all points
  return emission_left_out(origin, direction, sqrt(spread / max(level, 1e-30)), spread, level, glass_stops, bits.z);
}

// Whether some emissive mesh, drawn in this sample or not, leaves this group of receivers unlit: a ray that looks for triangles
// close by would not tell which mesh it meets. `light`: a point on any of them.
bool some_mesh_leaves_out(Light light, int group)
{
  return ((int(light_cone(light)) >> group) & 1) != 0;
}

// What a surface reflects towards `viewer` of light straight from the sources of this sample. Of every `light_rays`-th of them
// one is traced, drawn in proportion to what it brings unblocked: only visibility is sampled. All are weighed before any
// is traced: pixels that a processor runs together then trace together.
vec3 direct_reflected(Vertex met, vec3 viewer, int light_rays, uint salt)
{
  vec3 position = lit_position(met);
  vec3 normal = safe_normalize(met.turned);
  float left = length(met.turned);
  vec3 origin = ray_origin(position, met.lit);
  float bump = (met.upright < 0.99999) ? clamp(0.125 * (1.0 / (met.upright * met.upright) - 1.0), 0.0, 1.0) : 0.0;
  vec3 sum = met.leaving;
  uint roll = salt;
  int emissive = -1;  // a point on an emissive surface
  for (int group = 0; group < min(light_rays, light_count); group++) {
    float total = 0.0;
    float chosen_share = 0.0;
    int chosen = 0;
    vec3 chosen_light = vec3(0.0);
    vec3 chosen_direction = normal;
    for (int i = group; i < light_count; i += light_rays) {
      vec3 direction;
#ifdef HIT_LINKS
      int kind = int(sources.light[i * LIGHT_TEXELS].x);
      if (((kind >> 4 >> met.group) & 1) != 0) {
        continue;
      }
#endif
      Light light = light_read(i);
      emissive = (LIGHT_IS(light, LIGHT_SURFACE) && (light.flags & LIGHT_DIFFUSE) != 0) ? i : emissive;
      vec3 arriving = unblocked_irradiance(light, position, normal, direction);
      float above = dot(direction, met.lit);
      // Bumps shadow themselves, as bump_shadowing of lib/brdf.glsl says of what the camera sees.
      arriving *= (above > 0.0) ? left * ((bump > 0.0) ? bump_dimming(bump, max(above, 1e-6)) : 1.0) : 0.0;
      float share = luminance(abs(arriving));
      total += share;
      if (draw_passing(share, total, roll)) {
        chosen_share = share;
        chosen = i;
        chosen_light = arriving;
        chosen_direction = direction;
      }
    }
    if (total > DARK && chosen_share > 0.0) {
      Light light = light_read(chosen);
      if ((light.flags & LIGHT_SHADOW) != 0) {
        chosen_light *= light_passing(light, origin, chosen_direction, salt + uint(chosen));
      }
      chosen_light *= passing_media(origin, chosen_direction, light_distance(light, origin, chosen_direction), salt);
      sum += chosen_light * reflection_of(straight_reflection(met, light), normal, chosen_direction, viewer)
             * (total / chosen_share);
    }
  }
#ifdef HIT_LINKS
  emissive = (emissive >= 0 && some_mesh_leaves_out(light_read(emissive), met.group)) ? -1 : emissive;
#endif
  // A loop, since a rasteriser in software skips loops that no pixel enters, but no branches.
  for (; emissive >= 0; emissive = -1) {
    Light light = light_read(emissive);
    vec3 direction;
    vec3 arriving = emission_close_by(light, origin, normal, false, salt, direction);
    float above = dot(direction, met.lit);
    arriving *= (above > 0.0) ? left * ((bump > 0.0) ? bump_dimming(bump, max(above, 1e-6)) : 1.0) : 0.0;
    sum += PI * arriving * reflection_of(straight_reflection(met, light), normal, direction, viewer);
  }
  return sum;
}
