// The eye's projection without near and far plane: w = 0 is a direction, a vertex at infinity. The depth measure is made
// constant, as what lies before a receiver is decided by planes.
#include "ask/view.glsl"

vec4 project_flat(vec3 p, float finite_point)
{
  vec4 h = vec4(p, finite_point);
  float w = dot(film_view.row_w, h);
  return vec4(dot(film_view.row_x, h), dot(film_view.row_y, h), 0.5 * w, w);
}
