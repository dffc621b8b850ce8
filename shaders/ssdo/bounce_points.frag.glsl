// The thesis's bounce: every point taken for solid sends the radiance of the surface before it, as a patch of the area
// pi r^2 / N. No patch counts more than the directions that its point stands for, which needs no unit of length.
#include "ssdo/points.glsl"

void main()
{
  out_arriving = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  Surface s;
  if (!diffuse_surface(pixel, s)) {
    return;
  }
  vec3 viewer = TO_VIEWER(s);
  vec3 u = vec3(tile_numbers(pixel, film_view.bits_x, film_view.bits_y),
                tile_numbers(pixel, film_view.bits_z, film_view.bits_w).x);
  int points = fan_count * step_count;
  float area = PI * farthest * farthest / float(points);
  vec3 sum = vec3(0.0);
  for (int i = 0; i < points; i++) {
    vec3 numbers = point_numbers(u, i);
    Blocker found = point_blocker(s.position, hemisphere_direction(s.geometric_normal, numbers.xy), numbers.z);
    vec3 path = found.position - s.position;
    float range = length(path);
    if (found.share > 0.0 && range > 1e-4 * farthest) {
      vec3 direction = path / range;
      float leaving = max(-dot(found.normal, direction), 0.0);
      float arriving = max(dot(s.normal, direction), 0.0);
      float solid_angle = min(area * leaving / (range * range), 2.0 * PI / float(points));
      sum += senders_fetch(found.texel).rgb * passing_to(s.position, direction, range)
             * diffuse_weight(s, viewer, direction)
             * (found.share * arriving * solid_angle);
    }
  }
  out_arriving.rgb = sum / PI;
}
