// The thesis's occlusion: light of the world from the directions of the points that are not taken for solid. Divided by
// the sum of the cosines, so that open surfaces have exactly all of it.
#include "ssdo/points.glsl"
#include "lib/environment.glsl"

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
  vec3 sum = vec3(0.0);
  float whole = 0.0;
  for (int i = 0; i < fan_count * step_count; i++) {
    vec3 numbers = point_numbers(u, i);
    vec3 direction = hemisphere_direction(s.normal, numbers.xy);
    float cosine = dot(s.normal, direction);
    whole += cosine;
    if (dot(s.geometric_normal, direction) > 0.0) {
      float open = 1.0 - point_blocker(s.position, direction, numbers.z).share;
      sum += environment_radiance(direction) * diffuse_weight(s, viewer, direction) * (cosine * open);
    }
  }
  out_arriving.rgb = sum / max(whole, 1e-6);
}
