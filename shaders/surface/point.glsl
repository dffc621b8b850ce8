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

#ifdef WIDENS_STRANDS
#include "lib/random.glsl"
#include "surface/round_strand.glsl"
#endif

// How high above its triangle (x) and how far below it (y) a smooth-shaded surface is meant to run, on the viewer's side.
// With barycentric coordinates b, corners V and normals N the parabola  sum over edges of b_i b_j (V_j - V_i) . (N_j - N_i),
// which is what V . N, interpolated, is more than the point's own; and where normals lean together, up to the plane through
// the corner that lies furthest along them (addon/scene/envelope.py).
vec2 smooth_lift(Instance instance, bool back)
{
  float reach = length(world_normal);
#ifdef WIDENS_STRANDS
  if (strand_is_round()) {
    return vec2(0.0);  // strands are round as they are met
  }
#endif
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
#define STRAND_CLEAR 1.02  // radii of the tube's corners, of which each is known to 3 % where strands bend

bool strand_missed;  // by the pixel's ray, as surface_point finds

// Where a strand is met. What is seen of it is round, and goes around the tube's corners, so that rays from it do not meet the
// tube's own facets; of the far side, that open ends show, the tube will do.
void strand_meets(inout SurfacePoint point)
{
  vec3 along = safe_normalize(strand_along);
  float narrowing = dot(along, point.geometric_normal);  // of what faces the viewer: by so much along the strand
  // Where the pixel's ray runs beside the fragment's, in half pixels: the same for all strands.
  uvec3 salt = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(film_view.seed) ^ 0x68bc21ebu));
  vec2 looks = 2.0 * vec2(shuffled(film_view.sample_index, salt.xy), shuffled(film_view.sample_index, salt.yz)) - 1.0;
  // How far beside its axis that ray meets the strand, in radii.
  float beside = (strand_across.z + dot(strand_aside.xy, looks)) / -normal_heights.z;
  strand_missed = abs(beside) >= 1.0;
  float further = dot(strand_aside.zw, looks);
  if (point.backfacing) {
    point.position += (along - narrowing * point.geometric_normal) * further;
    return;
  }
  vec3 side = cross(along, point.incoming);
  float sine = length(side);
  side /= max(sine, 1e-20);
  vec3 before = cross(side, along);
  beside = clamp(beside, -1.0, 1.0);
  float height = sqrt(1.0 - beside * beside);
  vec3 out_there = side * beside + before * height;
  float radius = STRAND_CLEAR * strand_across.w;
  further += (radius * height - strand_across.y) * dot(along, point.incoming) / max(sine, 0.2);
  point.position += radius * out_there - side * strand_across.x - before * strand_across.y
                    + (along - narrowing * out_there) * further;
  point.normal = safe_normalize(out_there);
  point.mesh_normal = point.normal;
  point.geometric_normal = point.normal;
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
#ifdef WIDENS_STRANDS
  strand_missed = false;
  if (strand_is_round()) {
    strand_meets(point);
  }
#endif
  return point;
}

#include "lib/projection.glsl"
#include "generated/own_surface"
