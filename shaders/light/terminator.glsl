// Where a ray to a light begins on a smooth-shaded surface of few triangles, which shades as a curved one would but casts
// shadows as it is: without more, light ends at edges of triangles. As Cycles does (Object > Shading > Shadow Terminator,
// Geometry Offset .1): for light that comes in along the triangle or from below it, the ray begins where the curved surface
// would be (after Hanika, "Hacking the shadow terminator", Ray Tracing Gems II, 2021). For light that shines through, all of
// it is turned around.
#define TERMINATOR_CUTOFF 0.1

// Whether light arrives at the other side of the surface that is meant, whichever side of the triangle that is.
bool shines_through(int lobe_of_surface, vec3 normal, vec3 direction)
{
  return lobe_of_surface == LOBE_TRANSLUCENT && dot(normal, direction) < 0.0;
}

// `facing`: the plane on which the receiver lies, for what asks maps.
vec3 light_start(vec3 position, vec3 normal, vec3 plane, float lift, vec3 direction, inout vec3 facing)
{
  float cosine = dot(normal, direction);
  float plane_cosine = dot(plane, direction);
  float amount = clamp(((cosine < TERMINATOR_CUTOFF) ? 2.0 - (plane_cosine + cosine) / TERMINATOR_CUTOFF
                                                     : 1.0 - plane_cosine / TERMINATOR_CUTOFF), 0.0, 1.0);
  if (cosine <= 0.0 || lift <= 0.0) {
    return position;
  }
  facing = (plane_cosine <= 0.0) ? normal : facing;
  return position + normal * (lift * amount);
}
