// Shadow quad of a silhouette edge: from the edge to infinity, away from the light's centre.
#include "lib/math.glsl"
#include "edges/light.glsl"
#include "edges/project.glsl"

vec4 record_texel(int index)
{
  return quads_records_fetch(ivec2(index & 2047, index >> 11));
}

// Side of the eye as centre_side has it for receivers. Of an eye at infinity what remains of the product in the limit.
float eye_side(vec3 v0, vec3 v1)
{
  vec3 eye = edge_light.eye.xyz;
  if (!view_is_parallel(film_view.eye)) {
    return centre_side(v0 - eye, v1 - eye, towards_centre(eye));
  }
  if (light_at_infinity()) {
    return dot(cross(v1 - v0, eye), edge_light.centre.xyz);
  }
  return -dot(cross(v0 - edge_light.centre.xyz, v1 - edge_light.centre.xyz), eye);
}

void main()
{
  vec4 v0 = record_texel(2 * gl_InstanceID);
  vec4 v1 = record_texel(2 * gl_InstanceID + 1);
  bool second = number == 1 || number == 2 || number == 4;
  bool far = number == 2 || number == 4 || number == 5;
  vec3 v = second ? v1.xyz : v0.xyz;
  vec3 away = light_at_infinity() ? -edge_light.centre.xyz : v - edge_light.centre.xyz;
  flat_a = vec4(v0.xyz, v1.w);
  flat_b = vec4(v1.xyz, eye_side(v0.xyz, v1.xyz));
#ifdef GROUPS
  flat_group = v0.w;
#endif
  if (edge_light.reach > 0.0) {
    // An orthographic eye sees a direction along its own as any point of the horizon: quads end beyond all receivers.
    gl_Position = project_flat(far ? v + safe_normalize(away) * edge_light.reach : v, 1.0);
  }
  else {
    gl_Position = project_flat(far ? away : v, far ? 0.0 : 1.0);
  }
}
