// A caster that the camera looks through.
#include "edges/light.glsl"
#include "edges/project.glsl"

vec4 record_texel(int index)
{
  return triangles_records_fetch(ivec2(index & 2047, index >> 11));
}

void main()
{
  vec4 plane = record_texel(4 * gl_InstanceID + 3);
  flat_a = plane;
  float centre = light_at_infinity() ? dot(plane.xyz, edge_light.centre.xyz) : plane_side(plane, edge_light.centre.xyz);
  float eye = view_is_parallel(film_view.eye) ? dot(plane.xyz, edge_light.eye.xyz) : plane_side(plane, edge_light.eye.xyz);
  flat_b = vec4(centre, eye, record_texel(4 * gl_InstanceID).w, 0.0);
  gl_Position = project_flat(record_texel(4 * gl_InstanceID + number).xyz, 1.0);
}
