// Width of the camera's pixels at a place, in metres. Casters ask for the camera's, too, so that a bumped surface has
// the same shape for light as for the viewer.
float pixel_width(vec3 position)
{
  bool orthographic = material_scene.origin.w > 0.5;
  return material_scene.camera_right.w
         * (orthographic ? 1.0 : length(position - material_scene.camera_position.xyz));
}

// How far along the window's axes the surface point moves with `step` in its plane: the window's derivatives of an
// attribute times this is the attribute's change. `x`, `y`: those of the place.
vec2 steps_along(vec3 step, vec3 plane_normal, vec3 x, vec3 y)
{
  float area = dot(cross(x, y), plane_normal);
  return (area != 0.0) ? vec2(dot(cross(step, y), plane_normal), dot(cross(x, step), plane_normal)) / area : vec2(0.0);
}

vec2 window_steps(vec3 step, vec3 plane_normal)
{
  return steps_along(step, plane_normal, dFdx(world_position), dFdy(world_position));
}

// How high above its triangle (x) and how far below it (y) a smooth-shaded surface is meant to run, on the viewer's side.
// With barycentric coordinates b, corners V and normals N the parabola  sum over edges of b_i b_j (V_j - V_i) . (N_j - N_i),
// which is what V . N, interpolated, is more than the point's own; and where normals lean together, up to the plane through
// the corner that lies furthest along them (addon/scene/envelope.py).
vec2 smooth_lift(Instance instance, bool back)
{
  float reach = length(world_normal);
  if (reach <= 0.0) {
    return vec2(0.0);
  }
  vec3 from_origin = world_position - instance_origin(instance);
  float height = (normal_heights.x - dot(from_origin, world_normal)) / reach;
  vec2 lift = max(vec2(height, -height), normal_heights.yz / reach);
  lift *= step(vec2(4e-6 * length(from_origin)), lift);
  return back ? lift.yx : lift;
}

#ifdef WIDENS_STRANDS
// Whether the strand is drawn wider than it is here: minus its share of the width is 0 of what is no strand, -1 where all
// is kept (surface.vert.glsl).
bool strand_is_thin()
{
  return normal_heights.z < 0.0 && normal_heights.z > -0.9999;
}
#endif

// The point that a mesh fragment shades. Both normals are turned to the viewer's side, as Cycles does.

SurfacePoint surface_point(vec3 incoming, Instance instance)
{
  SurfacePoint point;
  point.position = world_position;
  point.incoming = incoming;
  // The plane of the triangle itself: interpolated normals say nothing about what the light can reach.
  vec3 flat_normal = safe_normalize(cross(dFdx(world_position), dFdy(world_position)));
  if (dot(flat_normal, incoming) < 0.0) {
    flat_normal = -flat_normal;
  }
  point.geometric_normal = flat_normal;
  point.backfacing = gl_FrontFacing == ((instance_flat.y & 1) == 1);
  vec3 shading_normal = safe_normalize(world_normal);
  if (dot(shading_normal, shading_normal) < 0.5) {
    shading_normal = flat_normal;
  }
  else if (point.backfacing) {
    shading_normal = -shading_normal;
  }
  point.normal = shading_normal;
  point.mesh_normal = shading_normal;
  point.ray = RAY_CAMERA;
  point.refracts = false;
  point.object_row0 = instance.row0;
  point.object_row1 = instance.row1;
  point.object_row2 = instance.row2;
  point.object_random = instance.random;
  point.object_index = instance.pass_index;
  instance_extras(instance_flat.x, point.object_color, point.instancer_generated, point.instancer_uv);
  point.object_attributes = instance_attributes(instance_flat.x);
  float width = pixel_width(world_position);
  // Heights are compared in one direction only, so bumps depend on it a little: Cycles' choice.
  vec3 beside = cross(vec3(1.0), flat_normal);
  beside = (dot(beside, beside) > 1e-12) ? beside : cross(vec3(-1.0, 1.0, 1.0), flat_normal);
  point.position_dx = normalize(beside);
  point.position_dy = cross(flat_normal, point.position_dx);
  point.position_dx *= width;
  point.position_dy *= width;
  fill_attributes(point, window_steps(point.position_dx, flat_normal), window_steps(point.position_dy, flat_normal));
  return point;
}

#include "lib/projection.glsl"
#include "generated/own_surface"
