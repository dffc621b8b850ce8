// Radiance along rays where the screen shows none.
#include "ssdo/fan.glsl"
#include "indirect/path.glsl"

// Radiance along a ray, with all that reaches its end in further reflections; paths go on at random.
vec3 path_radiance(vec3 origin, vec3 direction, uvec3 roll)
{
  vec3 sum = vec3(0.0);
  vec3 throughput = vec3(1.0);
  bool in_glass = false;  // of the last surface (Vertex)
  for (int bounce = 0; bounce < bounces; bounce++) {
    Vertex met;
    float t;
    if (!trace_vertex(origin, direction, 1e29, 0.0, in_glass, roll.z, met, t)) {
      break;
    }
    throughput *= passing_media(origin, direction, t, roll.y);
    roll = hash3(roll);
#ifdef MIRRORS_OWNED
    met.photons = met.photons && bounce == 0;
#endif
    sum += throughput * direct_reflected(met, -direction, 1, roll.x);
    float choice = to_unit(roll.z);
    roll = hash3(roll);
    vec3 reflected;
    vec2 u = vec2(to_unit(roll.x), to_unit(roll.y));
    direction = reflection_sample(met.reflection, met.lit, -direction, u, reflected);
    throughput *= even_share(met) * reflected;
    float stay = min(max_component(throughput), 1.0);
    if (choice >= stay) {
      break;
    }
    throughput /= stay;
    origin = ray_origin(lit_position(met), met.lit);
    in_glass = met.in_glass;
  }
  return sum;
}
