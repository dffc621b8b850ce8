// Light of emissive triangles so close that points on them leave it out (light/close_by.glsl), along a cosine-distributed ray of
// each pixel. Like rays to points it ends at glass where photons bring what passes that (`glass_blocks`).
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "lib/brdf.glsl"
#include "trace/rays.glsl"
#include "light/close_by.glsl"

void main()
{
  out_diffuse = vec4(0.0);
  out_glossy = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (surface_position_fetch(pixel).w == 0.0) {
    return;
  }
  Surface s = SURFACE_READ(pixel);
  uvec3 salt = hash3(uvec3(uvec2(pixel), uint(film_view.seed) + 37u));
  vec2 u = vec2(scrambled(film_view.bits_x, salt.x), scrambled(film_view.bits_y, salt.y));
  vec3 direction = cosine_direction(s.normal, u);
  if (!(max_component(s.diffuse) > 0.0) || dot(direction, s.geometric_normal) <= 0.0) {
    return;
  }
  vec3 origin = ray_origin(s.position, s.geometric_normal);
  uint roll = salt.z + uint(film_view.sample_index);
  vec3 arriving = emission_left_out(origin, direction, close_reach, drawn_least, mesh_light_level, glass_blocks != 0, roll);
  vec3 reflected = surface_diffuse_reflection(s, TO_VIEWER(s), direction) * (PI / max(dot(direction, s.normal), 1e-6));
  out_diffuse.rgb = arriving * reflected;
}
