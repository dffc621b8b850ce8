// How much the points of one light (row) differ in what they bring to a probe (column), a pixel of a coarse grid:
// mean and mean square of the irradiance by single points, visibility traced.
// Leaves out media: it asks how much points of a light differ, not how much arrives.
// Leaves out links: likewise.
#include "lib/gbuffer.glsl"
#include "light/sources.glsl"
#include "trace/rays.glsl"

void main()
{
  out_moments = vec4(0.0);
  ivec2 place = ivec2(gl_FragCoord.xy);
  vec2 probe = vec2(float(place.x % probes.x), float(place.x / probes.x));
  uvec3 bits = hash3(uvec3(uint(place.x), 7u, 5u));
  vec2 size = vec2(surface_position_size());
  ivec2 pixel = ivec2((probe + vec2(to_unit(bits.x), to_unit(bits.y))) / vec2(probes) * size);
  Surface s = SURFACE_READ(pixel);
  if (!s.hit) {
    return;
  }
  vec3 origin = ray_origin(s.position, s.geometric_normal);
  for (int k = 0; k < points; k++) {
    Light light = light_read(place.y * points + k);
    vec3 direction;
    float density;
    vec3 arriving = light_sample(light, s.position, direction, density);
    float irradiance = luminance(abs(arriving)) * max(dot(s.normal, direction), 0.0);
    if (irradiance > 0.0 && (light.flags & LIGHT_SHADOW) != 0) {
      float reach = light_distance(light, s.position, direction);
      irradiance *= clear_path(origin, direction, reach, bits.z);
    }
    out_moments.xy += vec2(irradiance, irradiance * irradiance) / float(points);
  }
}
