// One projection for all views: rows give clip x, y, w and the depth measure q (see addon/scene/view.py).
// z = w - 2 near q: for perspective an infinite far plane, for orthographic q in [0, 1].

vec4 project(vec3 p, vec4 to_x, vec4 to_y, vec4 to_w, vec4 to_q, float nearest)
{
  vec4 h = vec4(p, 1.0);
  float w = dot(to_w, h);
  return vec4(dot(to_x, h), dot(to_y, h), w - 2.0 * nearest * dot(to_q, h), w);
}

// Whether a projection turns its picture around, as a camera of negative scale does: what faces it then runs clockwise.
bool projection_mirrors(vec4 to_x, vec4 to_y, vec4 to_w, vec4 to_q, float nearest)
{
  return dot(cross(to_x.xyz, to_y.xyz), to_q.xyz - to_w.xyz) < 0.0;
}

// Depth of a place as the depth buffer of a view holds it, for fragments that are not where their triangle is.
float projected_depth(vec3 p, vec4 to_x, vec4 to_y, vec4 to_w, vec4 to_q, float nearest)
{
  vec4 h = vec4(p, 1.0);
  return 1.0 - nearest * dot(to_q, h) / dot(to_w, h);
}
