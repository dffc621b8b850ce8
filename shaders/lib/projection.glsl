// One projection for all views: rows give clip x, y, w and the depth measure q (see addon/frame/view.py).
// z = w - 2 near q: for perspective an infinite far plane, for orthographic q in [0, 1].

vec4 project(vec3 p, vec4 row_x, vec4 row_y, vec4 row_w, vec4 row_q, float near)
{
  vec4 h = vec4(p, 1.0);
  float w = dot(row_w, h);
  return vec4(dot(row_x, h), dot(row_y, h), w - 2.0 * near * dot(row_q, h), w);
}
