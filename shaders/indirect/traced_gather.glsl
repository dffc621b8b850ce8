// Virtual lights that are seen along rays.
#include "indirect/lights.glsl"

#define PARTS 32  // of the virtual lights: a choice looks for its part, then within

// Where pixels take turns, those side by side look at other SUBSETS of the virtual lights, which stand in an order along a curve
// through space: a mean over neighbours, of pixels or of samples, is one over all of them.
#ifdef SUBSETS
#define FIRST ((int(gl_FragCoord.x) + int(gl_FragCoord.y) + film_view.sample_index) % SUBSETS)
#else
#define SUBSETS 1
#define FIRST 0
#endif

// Irradiance at a surface by all virtual lights, and, given the surface's diffuse closure, what it reflects of it. Of all
// of them `rays` are traced, drawn in proportion to what they bring unblocked (systematic resampling); 0: none is, and
// walls let all light pass.
//
// A ray is traced where all pixels that a processor runs together have made their choice: each looks through as many
// virtual lights as the others. If every pixel traced as soon as its light has passed, each ray would be traced alone.
vec3 virtual_gather(Surface s, vec3 to_viewer, bool reflected, vec3 origin, float u, uint salt)
{
  vec3 direction;
  vec3 sum = vec3(0.0);
  int first = FIRST;
  if (rays == 0) {
    for (int i = first; i < virtual_count; i += SUBSETS) {
      VirtualLight light = virtual_light(i);
      float bounded = bounded_kernel(light, s.position, near_radius, direction) * max(dot(s.normal, direction), 0.0);
      sum += bounded * light.intensity * passing_media(origin, direction, distance(light.position, origin), salt + uint(i));
    }
    return (reflected ? sum * s.diffuse / PI : sum) * float(SUBSETS);
  }
  float passed[PARTS];  // what the parts up to each one bring
  int part_size = (virtual_count + PARTS * SUBSETS - 1) / (PARTS * SUBSETS) * SUBSETS;
  float total = 0.0;
  for (int part = 0; part < PARTS; part++) {
    for (int i = part * part_size + first; i < min((part + 1) * part_size, virtual_count); i += SUBSETS) {
      total += unblocked_share(i, s.position, s.normal, near_radius, false);
    }
    passed[part] = total;
  }
  if (!(total > DARK)) {
    return sum;
  }
  float step_size = total / float(rays);
  int part = 0;
  int traced = -1;
  vec3 intensity = vec3(0.0);
  for (int ray = 0; ray < rays; ray++) {
    float mark = (u + float(ray)) * step_size;
    while (part < PARTS - 1 && passed[part] <= mark) {
      part++;
    }
    float before = (part > 0) ? passed[part - 1] : 0.0;
    float chosen_share = 0.0;
    int chosen = -1;
    for (int i = part * part_size + first; i < min((part + 1) * part_size, virtual_count); i += SUBSETS) {
      float share = unblocked_share(i, s.position, s.normal, near_radius, false);
      if (share > 0.0 && (chosen < 0 || before <= mark)) {
        chosen = i;
        chosen_share = share;
      }
      before += share;
    }
    if (chosen < 0) {
      continue;
    }
    VirtualLight light = virtual_light(chosen);
    float bounded = bounded_kernel(light, s.position, near_radius, direction);
    if (dot(direction, s.geometric_normal) <= 0.0) {
      continue;
    }
    if (chosen != traced) {
      intensity = virtual_light_arriving(light, origin, salt + uint(chosen));
      traced = chosen;
    }
    vec3 arriving = intensity * (bounded * step_size / chosen_share);
    sum += arriving * (reflected ? surface_diffuse_reflection(s, to_viewer, direction)
                                 : vec3(max(dot(s.normal, direction), 0.0)));
  }
  return sum * float(SUBSETS);
}
