// Corner attributes by triangle: `hit_attributes` holds for each corner its place in object space and the attributes that
// the material reads, in rows of 2048 texels.
vec4 corner_texel(int index)
{
  return hit_attributes_fetch(ivec2(index & 2047, index >> 11));
}

// How far along its two edges a place on a triangle moves with a step in its plane.
vec2 edge_steps(vec3 step, vec3 e1, vec3 e2)
{
  vec3 across = cross(e1, e2);
  return vec2(dot(cross(step, e2), across), dot(cross(e1, step), across)) / max(dot(across, across), 1e-37);
}

vec3 turned_by(Instance instance, vec3 v)
{
  return vec3(dot(instance.row0.xyz, v), dot(instance.row1.xyz, v), dot(instance.row2.xyz, v));
}
