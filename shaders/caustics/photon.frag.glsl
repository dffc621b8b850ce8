// Photons of a light's view: what the lobe of a caster does with the light of a texel, and where that ends.
//
// `film_view` is the light's view. Neighbouring texels take the same numbers for lobes and interfaces, so that they stay a
// bundle; see addon/lighting/photons.py.
//
//   point   xyz where the photon ends; w: its path and the material there as a number above 0; 0: none
//   normal  xy of the triangle, octahedral, towards the photon; z: where the photon came from and what takes it
//           (caustics/arrival.glsl); w: blur that light and lobes leave to it, m
//   flux    rgb, W; w: how far neighbours would be if nothing had bent them, m
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/refraction.glsl"
#include "light/sources.glsl"
#include "trace/rays.glsl"
#include "trace/glass_color.glsl"
#include "caustics/emission.glsl"
#include "caustics/arrival.glsl"
#include "indirect/mirror_color.glsl"
#ifdef ABSORBING
vec3 solid_absorbs(int material)
{
  return interface_table_fetch(ivec2(2, material)).rgb;
}
#include "trace/solid.glsl"
#endif

#define PATHS 8192.0

// Fractional parts of multiples of two irrational numbers: other numbers for each interface, the same for all photons. In
// a picture of one sample they are the same, too: each photon takes the likelier way.
vec2 numbers_of(vec2 first, int interface_number)
{
  return fract(first + float(interface_number) * photon_light.spread.z * vec2(0.754877666, 0.569840291));
}

// What a photon's flux changes by where the normal that bends it is not that of the triangle it meets: light is followed
// here from its source, and a camera's ray that finds the same path measures angles to the shading normal (Veach 1997,
// 5.3.2: adjoint scattering functions of shading normals).
float adjoint(vec3 arriving, vec3 leaving, vec3 shading, vec3 geometric)
{
  float numerator = abs(dot(arriving, shading) * dot(leaving, geometric));
  float denominator = abs(dot(arriving, geometric) * dot(leaving, shading));
  return numerator / max(denominator, 1e-3 * numerator + 1e-30);
}

// Of a material with several interfaces the one that a photon of this flux takes, in proportion to what is left of it
// there: red light by the one for red, so that colours that are bent apart stay apart. False where it meets none.
bool interface_of(int material, vec3 flux, float number, inout vec4 glass, inout vec4 shape, out vec3 scale)
{
  scale = vec3(1.0);
  int width = interface_table_size().x;
  if (width == 3) {
    return number <= shape.y;
  }
  float shares = shape.y;
  float left = shape.y * luminance(flux * glass.rgb);
  for (int k = 3; k < width; k += 2) {
    float share = interface_table_fetch(ivec2(k + 1, material)).y;
    shares += share;
    left += share * luminance(flux * interface_table_fetch(ivec2(k, material)).rgb);
  }
  float chance = min(shares, 1.0);
  if (number > chance) {
    return false;
  }
  float below = number / chance * left;
  float part = shape.y * luminance(flux * glass.rgb);
  for (int k = 3; k < width; k += 2) {
    vec4 other_glass = interface_table_fetch(ivec2(k, material));
    vec4 other_shape = interface_table_fetch(ivec2(k + 1, material));
    if (below > part && other_shape.y > 0.0) {
      below -= part;
      glass = other_glass;
      shape = other_shape;
      part = shape.y * luminance(flux * glass.rgb);
    }
  }
  scale = vec3(shape.y * left / max(chance * part, 1e-30));
  return true;
}

void main()
{
  out_point = vec4(0.0);
  out_normal = vec4(0.0);
  out_flux = vec4(0.0);
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = surface_position_fetch(texel);
  bool inside = all(greaterThanEqual(place.xyz, photon_light.box_low.xyz)) && all(lessThanEqual(place.xyz, photon_light.box_high.xyz));
  if (place.w == 0.0 || !inside || max_component(surface_tint_fetch(texel).rgb) <= 0.0) {
    return;
  }
  Surface s = SURFACE_READ(texel);
  bool bends = photon_light.bends != 0;
  // A smooth mirror, or the face of glass; what a diffuse surface mirrors beside its own light stays with others.
  bool wanted = bends ? s.kind == LOBE_REFRACTION : s.kind < LOBE_REFRACTION;
  if (!wanted || (!bends && s.glossy_roughness > photon_light.box_high.w)) {
    return;
  }

  bool parallel = view_is_parallel(film_view.eye);
  float away;
  float area;
  vec3 direction;
  vec3 flux = texel_flux(s.position, direction, away, area);
  if (!(max_component(abs(flux)) > 0.0)) {
    return;
  }
  float width = sqrt(area);

  // The first interface, with its material's own lobe.
  vec2 u = photon_light.lobe.xy;
  vec3 weight;
  vec3 onward;
  vec3 geometric_normal = s.geometric_normal;
  float lobe_spread;
  if (bends) {
    Interface surface = interface_begin(s.glossy_normal, -direction, s.glossy_roughness, s.glossy_ior, s.glossy_tint,
                                        s.glossy_edge.x > 0.5, s.glossy_weight, vec3(0.0));
    onward = interface_sample(surface, u, 1.0, weight);
    lobe_spread = interface_is_smooth(surface) ? 0.0 : lobe_width(surface.alpha, true, s.glossy_ior);
  }
  else {
    Lobe lobe = lobe_begin(s, -direction);
    onward = lobe_sample(lobe, u, weight);
    lobe_spread = lobe_is_mirror(lobe) ? 0.0 : lobe_width(sqrt(lobe.alpha.x * lobe.alpha.y), false, 1.0);
  }
  bool passes = bends;
  // Smooth glass next to the light, then glass alone, which mirrors from within or is smooth; `photon_gloss`: 1 where gloss
  // sees the light through glass, 2 where it sees it mirrored, 4: maps for hits want all; `photon_diffuse`: 1 and 2 the same of
  // what diffuse surfaces see, by the last interface, which is the one next to them.
  bool clear = (photon_gloss & (bends ? 1 : 2)) != 0 && lobe_spread == 0.0 && (bends || surface_is_mirror_of_glass(s));
  if (passes != (dot(onward, geometric_normal) < 0.0)) {
    return;
  }
  // Radiance does not change with the medium here, as in Cycles: what a floor under water sends out is seen undimmed by
  // 1/n^2, and so the light on it is divided by it.
  flux *= bends ? weight / (s.glossy_ior * s.glossy_ior) : weight;
  flux *= adjoint(direction, onward, s.glossy_normal, geometric_normal);
  float path = bends ? 1.0 : 2.0;
  vec3 position = s.position;
  float travelled = 0.0;
  // How far the photon ends from here if it comes from beside this point of the light, of which samples leave that to it:
  // the angle between such ways, which faces bend as they bend light, and their distance.
  float apart_angle = photon_light.spread.x * (parallel ? 1.0 : 1.0 / max(away, 1e-30)) / (bends ? s.glossy_ior : 1.0);
  float apart = 0.0;
  float blur_squared = 0.0;
  uint salt = uint(photon_roll);
  for (int step = 0; step <= photon_light.interfaces; step++) {
    ivec2 hit;
    vec3 origin = ray_origin(position, passes ? -geometric_normal : geometric_normal);
    float t = trace_layers(origin, onward, 1e29, 0.0, salt + uint(step), true, false, hit);
    if (t >= 1e29) {
      return;
    }
    position = origin + t * onward;
    travelled += t;
    apart += apart_angle * t;
    flux *= layers_color(t) * passing_media(origin, onward, t);
    blur_squared += lobe_spread * lobe_spread * t * t;
    vec3 normal = triangle_normal(hit);
    int material = triangle_material(hit);
    vec4 glass = interface_table_fetch(ivec2(0, material));
    vec4 shape = interface_table_fetch(ivec2(1, material));
    vec4 body = interface_table_fetch(ivec2(2, material));
    vec3 smooth_normal = triangle_shading_normal(hit, position);
    normal = (dot(normal, smooth_normal) < 0.0) ? -normal : normal;  // out of the solid
    bool leaves = dot(normal, onward) > 0.0;
    vec2 numbers = numbers_of(photon_light.lobe.zw, step);
    vec3 of_interface = vec3(1.0);
    bool is_glass = shape.y > 0.0 && interface_of(material, flux, numbers.x, glass, shape, of_interface);
    bool mirrors = !is_glass && body.w > 0.5;
    if (is_glass && interface_table_size().x == 3) {
      glass.rgb = glass_color(hit, position, glass.rgb, glass.w, shape.y, shape.z > 0.5);
    }
#ifdef ABSORBING
    flux *= exp(-t * solid_absorption(origin, onward, t, hit, leaves, ray_offset(origin), salt + uint(step)));
#endif
    if (!is_glass && !mirrors) {
      // The end.
      bool to_diffuse = (photon_diffuse & (passes ? 1 : 2)) != 0;
      if (!to_diffuse && !clear && (photon_gloss & 4) == 0) {
        return;
      }
      float lobes = photon_light.spread.y * photon_light.spread.y * blur_squared;
      out_point = vec4(position, 1.0 + mod(path * 37.0 + float(material), PATHS));
      vec2 facing = octahedral_encode((dot(normal, onward) > 0.0) ? -normal : normal);
      out_normal = vec4(facing, arrival_encode(-onward, clear, to_diffuse), sqrt(apart * apart + lobes));
      out_flux = vec4(flux, width * (parallel ? 1.0 : (away + travelled) / away));
      return;
    }
    geometric_normal = leaves ? -normal : normal;
    smooth_normal = leaves ? -smooth_normal : smooth_normal;
    smooth_normal = (dot(smooth_normal, onward) < 0.0) ? smooth_normal : geometric_normal;
    vec2 drawn = numbers_of(photon_light.lobe.xy, step + 1);
    vec3 came = onward;
    if (is_glass) {
      float ior = leaves ? 1.0 / glass.w : glass.w;
      vec3 scale = vec3(1.0);
      if (shape.z > 1.5) {
        scale = glass_multiscatter(glass.rgb, -dot(smooth_normal, onward), shape.x, ior);
      }
      Interface surface = interface_begin(smooth_normal, -onward, shape.x, ior, vec3(dielectric_f0(ior)), shape.z > 0.5,
                                          scale * glass.rgb, scale * ((shape.w > 0.5) ? glass.rgb : vec3(1.0)));
      float strata = photon_light.spread.w;
      onward = interface_sample_strata(surface, drawn, (strata < 0.0) ? 0.5 : numbers.y, strata, weight);
      passes = dot(onward, smooth_normal) < 0.0;
      float chance = interface_mirror_chance(surface, interface_reflectance(surface, -dot(came, smooth_normal)));
      if (chance > 0.0 && chance * strata < 1.0 && strata > 0.0) {  // one of the samples mirrors here, of another weight than others
        weight *= passes ? photon_light.passing[min(step, 3)] : photon_light.mirroring;
      }
      weight /= passes ? ior * ior : 1.0;
      apart_angle /= passes ? ior : 1.0;
      lobe_spread = max(lobe_spread, interface_is_smooth(surface) ? 0.0 : lobe_width(surface.alpha, passes, ior));
    }
    else {
      float alpha = shape.x * shape.x;
      vec3 tangent;
      vec3 bitangent;
      orthonormal_basis(smooth_normal, tangent, bitangent);
      vec3 view = vec3(dot(-onward, tangent), dot(-onward, bitangent), max(dot(-onward, smooth_normal), 1e-6));
      vec3 h = vec3(0.0, 0.0, 1.0);
      if (alpha * alpha > MIRROR_ALPHA) {
        h = visible_normal(view, vec2(alpha), drawn);
        lobe_spread = max(lobe_spread, lobe_width(alpha, false, 1.0));
      }
      weight = mirror_color(material, dot(view, h));
      vec3 mirrored = 2.0 * dot(view, h) * h - view;
      onward = safe_normalize(mirrored.x * tangent + mirrored.y * bitangent + mirrored.z * smooth_normal);
      passes = false;
    }
    if (passes != (dot(onward, geometric_normal) < 0.0)) {
      return;
    }
    clear = clear && is_glass && (passes || leaves || lobe_spread == 0.0);
    flux *= of_interface * weight * adjoint(came, onward, smooth_normal, geometric_normal);
    path = mod(path * 3.0 + (passes ? 1.0 : 2.0), PATHS);
  }
}
