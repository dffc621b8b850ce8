// Direct light of this sample: one point on each light, or the light as a whole; visibility from depth maps.
//
// `generated/visibility` is the lookup of the technique in the shadow slot. With OWN_POINTS it also gives each pixel a
// point of its own (light/world_rays.glsl). With either that or LAYERS light takes the colours of layers that its ray passes.
// The point is the same for all pixels, so a narrow glossy lobe would see a few bright dots. Where rays are traced
// (light/traced.frag.glsl) such lobes take part of their light from there; both are weighted by the balance of squared
// densities (Veach's power heuristic), so the sum has the same mean.
//
// WAYS: whatever the surface reflects, glossy light is what falls across its direction, without the cosine, and out_ways has the
// sum of where mirrors would send it, by luminance (lighting/lit_points.py). w of out_glossy: of light that photons answer for
// where mirrors throw it (LIGHT_GLASS_BLOCKS, which is no matter for what glass passes here).
//
// IN_LOBES: diffuse surfaces reflect by the power `lobe_power` of the cosine, all together as much as by the cosine.
//
// KNOWN_IRRADIANCE: the lights are directions of the world, whose irradiance is known where nothing is in the way
// (lib/known_irradiance.glsl); what arrived of the light that was drawn, and that, are left in w, for light/openness.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "lib/brdf.glsl"
#ifdef SOFT_LOBES
#include "lib/soft_lobe.glsl"
#endif
#include "light/terminator.glsl"
#include "light/whole.glsl"
#include "ask/grass.glsl"
#include "generated/visibility"
#include "ask/links.glsl"
#include "media/light.glsl"
#ifdef KNOWN_IRRADIANCE
#include "lib/known_irradiance.glsl"
#endif

vec3 diffuse_reflection(Surface s, GrassSeen grass, vec3 to_viewer, vec3 direction)
{
#ifdef IN_LOBES
  float about = 0.5 * (lobe_power + 1.0) * pow(max(dot(s.normal, direction), 0.0), lobe_power);
  return (about > 0.02) ? s.diffuse * about / PI : vec3(0.0);
#endif
  return grass.exists ? grass_reflection(grass, s, direction) : surface_diffuse_reflection(s, to_viewer, direction);
}

// Irradiance in closed form times the closure towards the light's middle: exact for Lambert's.
vec3 whole_diffuse(Light light, Surface s, vec3 to_viewer, vec3 direction, GrassSeen grass)
{
  vec3 irradiance = whole_irradiance(light, s.position, s.normal, direction);
  float cosine = dot(s.normal, direction);
  // From a middle below the horizon the part above it shines in along the surface.
  vec3 raised = (cosine > 0.05) ? direction : safe_normalize(direction + s.normal * (0.05 - cosine));
  vec3 share = diffuse_reflection(s, grass, to_viewer, raised);
  return share * irradiance / max(dot(s.normal, raised), 1e-3);
}

// How far off the triangle light from `direction` finds the surface that is meant. Cycles lifts rays that it draws from the
// world's own light, of which a single colour has none, and not those that it draws from the surface; power heuristic.
float meant_height(Light light, ivec2 pixel, float lift, vec3 normal, vec3 direction)
{
  if (lift <= 0.0 || !LIGHT_IS(light, LIGHT_DIRECTION)) {
    return lift;
  }
  float of_surface = max(dot(normal, direction), 0.0) / PI;
  float of_world = max(light.area, 0.25 / PI);  // without what guides it to where receivers see the world
  float share = of_world * of_world / (of_world * of_world + of_surface * of_surface);
  bool lifted = to_unit(roll_of(pixel, film_view.sample_index, film_view.seed, 31).x) < share;
  return (lifted && (light.flags & LIGHT_EVEN) == 0) ? lift : 0.0;
}

// What a lobe reflects of a point of a light that lies in `direction`. `samples`: how dense such points are beside rays of
// the lobe that find the light, too; 0: none do. `inside`: only rays leave the object again.
vec3 lobe_light(Lobe lobe, vec3 direction, float samples, bool inside)
{
  float density;
  vec3 reflected = lobe_reflection(lobe, direction, density);
  float ratio = density / max(samples, 1e-30);
  return (samples > 0.0) ? (inside ? vec3(0.0) : reflected / (1.0 + ratio * ratio)) : reflected;
}

void main()
{
  out_diffuse = vec4(0.0);
  out_glossy = vec4(0.0);
#ifdef WAYS
  out_ways = vec4(0.0);
#endif
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = surface_mirrored(SURFACE_READ(pixel));
  vec3 to_viewer = TO_VIEWER(s);
  GrassSeen grass = grass_see(pixel, s);
  bool has_diffuse = max_component(s.diffuse) > 0.0;
  bool has_glossy = s.kind != LOBE_REFRACTION && max_component(s.glossy_weight) > 0.0;
#ifdef SOFT_LOBES
  SoftLobe soft = soft_lobe_begin(s, to_viewer);
  has_glossy = has_glossy && !soft.exists;
#endif
  Lobe lobe;
  if (has_glossy) {
    lobe = lobe_begin(s, to_viewer);
    has_glossy = !lobe_is_mirror(lobe);
  }
  Lobe coat;
  bool has_coat = s.coated;
  if (has_coat) {
    coat = lobe_begin(surface_coat(s), to_viewer);
    has_coat = !lobe_is_mirror(coat);
  }
  bool traced = s.glossy_roughness <= traced_roughness;
  int group = receiver_group(pixel);
  vec3 diffuse = vec3(0.0);
  vec3 glossy = vec3(0.0);
#ifdef WAYS
  float by_photons = 0.0;
#endif
#ifdef KNOWN_IRRADIANCE
  vec3 drawn = vec3(0.0);
  float arrived = 0.0;
  bool known = false;
#endif
  for (int i = 0; i < light_count; i++) {
    Light light = light_read(i);
    if (light_leaves_out(light, group)) {
      continue;
    }
#ifdef OWN_POINTS
    light = own_point(light, i);
#endif
#ifdef WAYS
    bool thrown = (light.flags & LIGHT_GLASS_BLOCKS) != 0;
    light.flags &= ~LIGHT_GLASS_BLOCKS;
#endif
    bool whole = LIGHTS_HAVE(LIGHT_AS_A_WHOLE) && (light.flags & LIGHT_WHOLE) != 0;
    bool on_diffuse = has_diffuse && (light.flags & LIGHT_DIFFUSE) != 0;
    bool on_glossy = has_glossy && (light.flags & LIGHT_GLOSSY) != 0;
    bool on_coat = has_coat && (light.flags & LIGHT_GLOSSY) != 0;
    bool by_points = !whole || on_glossy || on_coat;
#ifdef SOFT_LOBES
    by_points = by_points || soft.exists;
#endif
    int parts = by_points ? (whole ? WHOLE_PARTS : 1) : 0;
    vec3 from_diffuse = vec3(0.0);
    vec3 from_glossy = vec3(0.0);
    vec3 towards = vec3(0.0);
#ifdef KNOWN_IRRADIANCE
    vec3 falling = vec3(0.0);
#endif
    if (whole) {
      towards = LIGHT_IS(light, LIGHT_SUN) ? light.centre : safe_normalize(light.centre - s.position);
    }
    if (whole && on_diffuse) {
      from_diffuse = whole_diffuse(light, s, to_viewer, towards, grass);
    }
    for (int part = 0; part < parts; part++) {
      Light source = light;
      if (whole) {
        source = whole_part(light, part, s.position);
      }
      vec3 direction;
      float density;
      vec3 arriving = light_sample(source, s.position, direction, density);
#ifdef KNOWN_IRRADIANCE
      falling = arriving * max(dot(s.normal, direction), 0.0);
      known = known || on_diffuse;
      drawn += light.radius * falling;  // openness of its direction
#endif
      if (on_diffuse && !whole) {
        from_diffuse += arriving * diffuse_reflection(s, grass, to_viewer, direction);
      }
#ifdef WAYS
      from_glossy += (dot(s.normal, direction) > 0.0) ? arriving : vec3(0.0);
#endif
      // Rays of the lobe, which take the other part of this light, drop what lies below the surface, too.
      towards = whole ? towards : direction;
      // None between a surface and the mirror's normal that was bent up from it (reflecting_normal).
      bool in_front = s.bump > 0.0 || dot(direction, s.normal) > 0.0 || surface_is_edited(s);
      if (in_front && (s.lift > 0.0 || may_mirror(s, direction))) {
        float rays = LIGHT_IS(light, LIGHT_SURFACE) ? 1.0 : float(CANDIDATES);
        float samples = (density > 0.0 && (light.flags & LIGHT_TRACED) != 0) ? light.rate * density / rays : 0.0;
        if (on_glossy) {
          from_glossy += lobe_light(lobe, direction, traced ? samples : 0.0, enters_itself(s, direction)) * arriving;
        }
        if (on_coat) {
          from_glossy += lobe_light(coat, direction, samples, enters_itself(s, direction)) * arriving;
        }
      }
#ifdef SOFT_LOBES
      if (soft.exists) {
        // Cycles draws the world's light of fibres from the fibre.
        bool drawn_from = soft.fibre && LIGHT_IS(light, LIGHT_DIRECTION);
        vec3 from_soft = (drawn_from ? soft_shape(soft, direction) : soft_reflection(soft, direction)) * arriving;
        from_diffuse += ((light.flags & LIGHT_DIFFUSE) != 0 && !soft.glossy) ? from_soft : vec3(0.0);
        from_glossy += ((light.flags & LIGHT_GLOSSY) != 0 && soft.glossy) ? from_soft : vec3(0.0);
      }
#endif
    }
    if (max_component(abs(from_diffuse) + abs(from_glossy)) > 0.0) {
      float visibility = 1.0;
      if ((light.flags & LIGHT_SHADOW) != 0) {
        float side = shines_through(s.kind, s.normal, towards) ? -1.0 : 1.0;
        vec3 facing = side * s.geometric_normal;
        float lift = meant_height(light, pixel, (side < 0.0) ? s.sink : s.lift, side * s.normal, towards);
        vec3 start = light_start(s.position, side * s.normal, facing, lift, towards, facing);
#ifdef SOFT_LOBES
        if (soft.fibre) {
          start = fibre_start(soft, s.position, towards, facing);
        }
#endif
        visibility = light_visibility(light, pixel, start, facing);
#if defined(OWN_POINTS) || defined(LAYERS)
        vec3 layers = layers_color(light_distance(light, s.position, towards));  // that the ray has passed
        from_diffuse *= layers;
        from_glossy *= layers;
#endif
      }
      vec3 passing = light_through_media(light, pixel, s.position, towards);
      from_diffuse *= passing;
      from_glossy *= passing;
      diffuse += from_diffuse * visibility;
      glossy += from_glossy * visibility;
#ifdef WAYS
      float across = luminance(abs(from_glossy)) * visibility;
      out_ways += vec4(reflect(-towards, s.normal), 1.0) * across;
      by_photons += thrown ? across : 0.0;
#endif
#ifdef KNOWN_IRRADIANCE
      arrived += luminance(abs(falling)) * visibility;
#endif
    }
  }
  out_diffuse = vec4(diffuse, 0.0);
  out_glossy = vec4(glossy, 0.0);
#ifdef WAYS
  out_glossy.w = by_photons;
#endif
#ifdef KNOWN_IRRADIANCE
  if (known) {
    float all = luminance(abs(drawn));
    vec3 missing = known_share * known_irradiance(s.normal) - drawn;
    out_diffuse.rgb += openness_of(pixel, arrived, all) * missing * s.diffuse / PI;
    out_diffuse.w = arrived;
    out_glossy.w = all;
  }
#endif
}
