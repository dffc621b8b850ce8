// How what lies infinitely far behind all moves in the picture: as the camera turns and zooms. VECTOR_OUT, HIT_OUT: the
// outputs of passes of surfaces (techniques/shader_aovs.py) that hold it and count it.
#include "ask/view.glsl"
#include "surface/motion.glsl"

vec3 motion_far(int camera, vec3 direction)
{
  float w = dot(motion_texel(3 * camera + 2).xyz, direction);
  vec2 place = vec2(dot(motion_texel(3 * camera).xyz, direction), dot(motion_texel(3 * camera + 1).xyz, direction));
  return (w > 1e-6) ? vec3(0.5 * film_view.film.xy * place / w, 1.0) : vec3(0.0);
}

void main()
{
  AOV_NONE
  vec3 direction = view_direction(gl_FragCoord.xy);
  vec3 now = motion_far(0, direction);
  vec3 before = motion_far(1, direction);
  vec3 after = motion_far(2, direction);
  VECTOR_OUT = vec4((before.xy - now.xy) * (now.z * before.z), (now.xy - after.xy) * (now.z * after.z));
  HIT_OUT = 1.0;
}
