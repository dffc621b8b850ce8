// Pixels from whose view points are found that light the picture: one in each cell of a grid, another in every sample.
// Those that show glass stand for what is straight behind it, and those that show metal for what is mirrored there: a
// virtual light sends to all sides what its probe saw of it, and of two mirrors one sees highlights of lamps in the other
// that nothing else sees. A program includes indirect/path.glsl before.
#include "ask/view.glsl"
#define MOST_MIRRORS 4  // one behind another, that a probe looks at
#define WIDE_LOBE 0.55  // roughness from which a lobe sends its light about as far around as a virtual light does

struct Probe {
  bool receives;
  vec3 position;
  vec3 normal;
  vec3 geometric_normal;
};

// Whether what a surface mirrors is most of what it sends on.
bool is_metal(vec3 diffuse, vec3 straight)
{
  return luminance(straight) > luminance(diffuse);
}

Probe probe_read(int index)
{
  uvec3 bits = hash3(uvec3(uint(index), 91u, uint(film_view.seed)));
  vec2 within = vec2(scrambled(film_view.bits_z, bits.x), scrambled(film_view.bits_w, bits.y));
  vec2 cell = vec2(float(index % probes.x), float(index / probes.x));
  ivec2 pixel = ivec2((cell + within) / vec2(probes) * vec2(surface_position_size()));
  Surface s = SURFACE_READ(pixel);
  Probe probe;
  probe.receives = s.hit && (max_component(s.diffuse) > 0.0 || max_component(s.glossy_weight) > 0.0);
  probe.position = s.position;
  probe.normal = s.normal;
  probe.geometric_normal = s.geometric_normal;
  bool glass = s.kind == LOBE_REFRACTION;
  if (probe.receives && (glass || (s.kind <= FRESNEL_F82 && s.glossy_roughness < WIDE_LOBE && is_metal(s.diffuse, s.glossy_weight * s.glossy_tint)))) {
    vec3 onward = -TO_VIEWER(s);
    uint salt = bits.z + uint(film_view.sample_index);
    vec3 beside = s.geometric_normal;
    if (glass) {
      beside *= (dot(onward, s.geometric_normal) < 0.0) ? -1.0 : 1.0;
    }
    else {
#ifdef HAS_SURFACE_EDIT
      s.edit = vec4(0.0);  // what an edit bends is seen here alone
#endif
      uvec3 roll = hash3(uvec3(uint(index), salt, uint(film_view.seed)));
      vec3 ignored;
      onward = lobe_sample(lobe_begin(s, -onward), vec2(to_unit(roll.x), to_unit(roll.y)), ignored);
      probe.receives = may_mirror(s, onward);
      beside = side_of_ray(s, onward);
    }
    for (int step = 0; step < MOST_MIRRORS && probe.receives; step++) {
      ivec2 hit;
      vec3 origin = ray_origin(probe.position, beside);
      float t = trace_nearest(origin, onward, 1e29, salt, hit);
      probe.receives = t < 1e29;
      if (!probe.receives) {
        break;
      }
      probe.position = origin + t * onward;
      probe.normal = triangle_normal(hit);
      probe.normal *= (dot(probe.normal, onward) > 0.0) ? -1.0 : 1.0;
      probe.geometric_normal = beside = probe.normal;
      Reflection met = mean_reflection(hit);
      if (glass || !is_metal(met.diffuse, met.straight)) {
        break;
      }
      onward = reflect(onward, probe.normal);
      probe.receives = step + 1 < MOST_MIRRORS;
    }
  }
  return probe;
}
