// A light as the edges of its shadows see it; the block `edge_light` is EDGE_LIGHT of addon/lighting/edge_tiles.py.
//
// Sides of planes are asked in coordinates relative to the receiver, in one place each, and 0 counts as positive
// everywhere: neighbouring edges and triangles then agree, and counts are exact integers.

bool light_at_infinity()
{
  return edge_light.centre.w > 0.5;
}

// From a receiver to the light's centre; at infinity the unit direction.
vec3 towards_centre(vec3 p)
{
  return light_at_infinity() ? edge_light.centre.xyz : edge_light.centre.xyz - p;
}

// The plane through a receiver and an edge, asked for the centre: positive on one side, negative on the other. `a` and `b`
// are the edge's ends from the receiver, `c` is towards_centre.
float centre_side(vec3 a, vec3 b, vec3 c)
{
  return dot(cross(a, b), c);
}

// The side of a triangle's plane on which a point lies.
float plane_side(vec4 plane, vec3 p)
{
  return dot(plane.xyz, p) + plane.w;
}
