// What surfaces send along rays, of light that virtual lights leave to rays and of all.
//
// Virtual lights are bounded where they are near: one at distance d counts min(1, d2 / r2) of its light, a ray that meets a
// surface at distance d counts 1 - min(1, d2 / r2) of what that sends. What smooth metal mirrors of other surfaces virtual
// lights do not send (indirect/candidates.frag.glsl): rays meet that at any distance, and go on over the mirror. A program
// that includes this has the constants `virtual_count`, `near_radius`, `glossy_radius` and `deeper`, and of the box
// around all mirrors `mirrors_low` and `mirrors_high`, besides those of indirect/path.glsl.
#define SHEETS_FIND_SKY
#include "indirect/path.glsl"
#include "indirect/lights.glsl"

// How far along a ray mirrors may stand: up to where it leaves the box around all of them.
float mirror_limit(vec3 origin, vec3 direction)
{
#ifdef MIRRORS_DROPPED
  return 0.0;
#else
  vec3 inverse = vec3(1.0) / mix(direction, vec3(1e-20), equal(direction, vec3(0.0)));
  vec3 low = (mirrors_low - origin) * inverse;
  vec3 high = (mirrors_high - origin) * inverse;
  vec3 first = min(low, high);
  vec3 last = max(low, high);
  float leave = min(min(last.x, last.y), last.z);
  return (max(max(first.x, first.y), first.z) <= leave) ? max(leave, 0.0) : 0.0;
#endif
}

// Where a ray is on its way.
struct Walk {
  vec3 origin;
  vec3 direction;
  int bounce;   // how often light of sources has been reflected when it comes along here to what the picture shows
  bool whole;   // it brings all light of what it meets, however far that is
  bool gloss;   // it begins at a glossy lobe that takes photons (caustics/gloss.glsl)
  bool soft;    // it begins at a lobe without microfacets that takes them as diffuse surfaces do
  bool in_glass; // it begins at a point in glass, whose light counts what the glass mirrors back (Vertex.in_glass)
  bool has_met; // it has met `met` already
  Vertex met;
};

// Radiance that arrives along a walk's ray: light of sources that a surface reflects, virtual lights, and what surfaces
// nearer to that one than `reach` send to it, each with the share that virtual lights leave to it, and what reaches those in
// the same way: that last light, of which there is little and which takes most of the time where small things stand close,
// only some samples look for (`deeper`: the weight that it has in them, 0 in the others; below 0 where it is left out but
// for what comes over mirrors, which virtual lights do not send). What a sheet of glass mirrors from within has one ray
// beyond `bounces`.
vec3 radiance_along(Walk walk, float reach, uvec3 roll)
{
  // Where a sample has no virtual lights, rays go as far as one light would leave to them.
  bool none = virtual_count > 0 && dot(abs(virtual_lights_fetch(ivec2(0))), vec4(1.0)) == 0.0;
  reach *= none ? sqrt(float(virtual_count)) : 1.0;
  vec3 sum = vec3(0.0);
  vec3 throughput = vec3(1.0);
  bool from_seen = walk.bounce == 1 && (!walk.whole || walk.soft);  // from a surface of the picture, over smooth metal alone
  bool from_gloss = walk.bounce == 1 && walk.gloss;  // from such a lobe, over glass alone
  bool farther = false;                              // a surface has sent light along the walk by virtual lights
  bool from_glass = false;                           // glass has mirrored it, such that rays find lights
#ifdef GLASS_MIRRORS
  Vertex mirror;  // that glass
#endif
  for (; walk.bounce <= bounces || from_glass; walk.bounce++) {
    float share = 1.0;
    bool mirrored = false;
    if (!walk.has_met) {
      float t;
      float limit = walk.whole ? 1e29 : reach;
      float last_mirror = mirror_limit(walk.origin, walk.direction);
      bool meets = trace_vertex(walk.origin, walk.direction, limit, last_mirror, walk.in_glass, roll.z, walk.met, t);
#ifdef GLASS_MIRRORS
      for (; from_glass; from_glass = false) {
        float end = meets ? t : 1e29;
        sum += throughput * walk.met.passed * mirrored_lights(mirror, walk.origin, walk.direction, end, roll.y);
      }
#endif
      if (!meets || walk.bounce > bounces) {
        break;
      }
      share = walk.whole ? 1.0 : max(1.0 - t * t / (reach * reach), 0.0);
      throughput *= walk.met.passed;
      throughput *= passing_media(walk.origin, walk.direction, t, roll.y);
#ifdef SMOOTH_MIRRORS
      mirrored = mirror_drawn(walk.met, -walk.direction, to_unit(hash3(roll).y), !walk.whole);
      if (farther && deeper < 0.0 && !mirrored && !walk.whole) {
        break;
      }
#endif
      if (max_component(throughput) * (mirrored ? 1.0 : share) <= 1e-4) {
        break;
      }
    }
#ifdef MIRRORS_OWNED
    // Photons bring what a mirror sends to a diffuse surface of the picture, what glass does to gloss, too, and to no other.
    from_gloss = from_gloss && walk.met.glass;
    walk.met.photons = walk.met.photons && (from_seen || from_gloss);
#endif
    walk.has_met = false;
    walk.in_glass = walk.met.in_glass;
    walk.whole = mirrored;
    roll = hash3(roll);
    float direct_share = share;
#ifdef MIRRORS_OWNED
    // Virtual lights send nothing of what metal mirrors of lights that photons answer for.
    walk.met.others = mirrored ? share : 1.0;
    direct_share = mirrored ? 1.0 : share;
#endif
    if (direct_share > 0.0) {
      sum += throughput * direct_share * direct_reflected(walk.met, -walk.direction, 1, roll.x);
    }
#ifdef SMOOTH_MIRRORS
    if (mirrored) {
      roll = hash3(roll);
      vec3 reflected;
      walk.direction = mirror_sample(walk.met, -walk.direction, vec2(to_unit(roll.x), to_unit(roll.y)), reflected);
      throughput *= reflected;
      walk.origin = ray_origin(walk.met.position, walk.met.normal);
#ifdef GLASS_MIRRORS
      from_glass = walk.met.within || walk.met.by_rays > 0.0;
      mirror = walk.met;
#endif
      continue;
    }
#endif
    throughput *= share;
    if (walk.bounce < bounces) {
      vec3 from;
      vec3 arriving = virtual_irradiance(lit_position(walk.met), walk.met.lit, reach, walk.bounce > 0, roll.z, from);
      vec3 sent = reflection_of(walk.met.reflection, walk.met.lit, from, -walk.direction);
      sum += throughput * even_share(walk.met) * arriving * sent;
    }
    if (walk.bounce > 0 && !farther) {
#if defined(SMOOTH_MIRRORS) && !defined(MIRRORS_DROPPED)
      bool ends = deeper == 0.0;
#else
      bool ends = deeper <= 0.0;
#endif
      if (ends) {
        break;
      }
      throughput *= abs(deeper);
      farther = true;
    }
    from_seen = walk.bounce == 0;
    from_gloss = from_glass = false;
    roll = hash3(roll);
    vec3 reflected;
    vec2 u = vec2(to_unit(roll.x), to_unit(roll.y));
    walk.direction = reflection_sample(walk.met.reflection, walk.met.lit, -walk.direction, u, reflected);
    throughput *= even_share(walk.met) * reflected;
    walk.origin = ray_origin(lit_position(walk.met), walk.met.lit);
  }
  return sum;
}

// Radiance that arrives at a surface that the picture shows, along a ray from surfaces nearer than the bound (from all
// surfaces, if `whole`). Behind a `whole` ray, of a lobe, the bound is `glossy_radius`: paths between surfaces that shine
// bring much by few, and no filter spreads that. From strand to strand (`onward`) it is `near_radius`: virtual lights send
// what they find to all sides, strands ahead. `gloss`, `soft`: as of a walk.
vec3 near_radiance(vec3 origin, vec3 direction, bool whole, bool onward, bool gloss, bool soft, uvec3 roll)
{
  Walk walk;
  walk.origin = origin;
  walk.direction = direction;
  walk.bounce = 1;
  walk.whole = whole;
  walk.gloss = gloss;
  walk.soft = soft;
  walk.in_glass = false;
  walk.has_met = false;
  return radiance_along(walk, (whole && !onward) ? glossy_radius : near_radius, roll);
}
