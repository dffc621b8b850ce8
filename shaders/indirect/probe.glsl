// Pixels from whose view points are found that light the picture: one in each cell of a grid, another in every sample.
// Those that show glass stand for what is straight behind it. A program includes indirect/path.glsl before.

struct Probe {
  bool receives;
  vec3 position;
  vec3 normal;
  vec3 geometric_normal;
};

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
  if (probe.receives && s.kind == LOBE_REFRACTION) {
    vec3 onward = (film_view.eye.w > 0.5) ? -film_view.backward.xyz : safe_normalize(s.position - film_view.eye.xyz);
    vec3 beyond = (dot(onward, s.geometric_normal) < 0.0) ? -s.geometric_normal : s.geometric_normal;
    ivec2 hit;
    vec3 origin = ray_origin(s.position, beyond);
    float t = trace_nearest(origin, onward, 1e29, bits.z + uint(film_view.sample_index), hit);
    probe.receives = t < 1e29;
    if (probe.receives) {
      probe.position = origin + t * onward;
      probe.normal = triangle_normal(hit);
      probe.normal *= (dot(probe.normal, onward) > 0.0) ? -1.0 : 1.0;
      probe.geometric_normal = probe.normal;
    }
  }
  return probe;
}
