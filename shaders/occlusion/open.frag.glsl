// The pass Ambient Occlusion: whether a ray from the surface that a pixel sees, drawn by the cosine, meets nothing within
// `farthest` metres. Directions are stratified over the points of the picture.
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "trace/rays.glsl"

void main()
{
  out_open = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  Surface s = SURFACE_READ(pixel);
  if (!s.hit) {
    return;
  }
  uvec3 roll = roll_of(pixel, 0, film_view.seed, 251);
  vec2 u = vec2(shuffled(point_number, roll.xy), shuffled(point_number, roll.yz));
  vec3 direction = cosine_direction(s.normal, u);
  if (dot(direction, s.geometric_normal) > 0.0) {
    float open = clear_path(ray_origin(s.position, s.geometric_normal), direction, farthest, roll.x + uint(point_number));
    out_open = vec4(vec3(open), 1.0);
  }
}
