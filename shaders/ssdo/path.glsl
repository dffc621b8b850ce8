// Radiance along rays where the screen shows none.
#include "ssdo/fan.glsl"
#include "indirect/path.glsl"

// Radiance along a ray, with all that reaches its end in further reflections; paths go on by lot.
vec3 path_radiance(vec3 origin, vec3 direction, uvec3 roll)
{
  vec3 sum = vec3(0.0);
  vec3 throughput = vec3(1.0);
  for (int bounce = 0; bounce < bounces; bounce++) {
    Vertex vertex;
    float t;
    if (!trace_vertex(origin, direction, 1e29, roll.z, vertex, t)) {
      break;
    }
    roll = hash3(roll);
    throughput *= vertex.albedo;
    sum += throughput * direct_irradiance(vertex.position, vertex.normal, 1, to_unit(roll.x), roll.y) / PI;
    float stay = min(max_component(throughput), 1.0);
    if (to_unit(roll.z) >= stay) {
      break;
    }
    throughput /= stay;
    roll = hash3(roll);
    direction = cosine_direction(vertex.normal, vec2(to_unit(roll.x), to_unit(roll.y)));
    origin = ray_origin(vertex.position, vertex.normal);
  }
  return sum;
}
