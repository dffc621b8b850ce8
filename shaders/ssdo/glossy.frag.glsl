// What glossy surfaces reflect of other surfaces: one ray of the lobe.
#include "ssdo/path.glsl"

void main()
{
  out_glossy = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  if (s.kind > FRESNEL_F82 || max_component(s.glossy_weight) <= 0.0) {
    return;
  }
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 57u));
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 29);
  Lobe lobe = lobe_begin(s, TO_VIEWER(s));
  vec3 weight;
  vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
  vec3 direction = lobe_sample(lobe, u, weight);
  if (max_component(weight) > 0.0 && dot(direction, s.geometric_normal) > 0.0) {
    out_glossy.rgb = weight * path_radiance(ray_origin(s.position, s.geometric_normal), direction, roll);
  }
}
