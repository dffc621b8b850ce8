// What emissive triangles close to a place bring that their points leave out: one at distance d counts min(1, d2 / least) of its
// light (light_sample), so that a thin lamp on a shelf would light hardly anything of that. A ray meets them: one at distance d
// counts the rest. What includes this has trace/rays.glsl.
#include "ask/media.glsl"

// Radiance along the ray, of what is met before `reach`. `spread`: least times what points are drawn in proportion to
// (emissive_density with `level`), the same of all; `glass_stops`: as it does the rays to points.
vec3 emission_left_out(vec3 origin, vec3 direction, float reach, float spread, float level, bool glass_stops, uint salt)
{
  ivec2 hit;
  float t = trace_layers(origin, direction, reach, 0.0, salt, glass_stops, false, hit);
  if (t >= reach) {
    return vec3(0.0);
  }
  vec3 ignored;
  vec3 emission = triangle_emission(hit, direction, ignored);
  float missing = max(1.0 - t * t * emissive_density(emission, level) / spread, 0.0);
  return emission * layers_color(t) * media_transmittance(origin, direction, min(t, FARTHEST_MEDIUM), salt) * missing;
}
