// Bump mapping from heights at three places: Mikkelsen, "Bump Mapping Unparametrized Surfaces on the GPU", 2010,
// with differences along the surface instead of the window's derivatives of the height, as in Cycles: heights that
// change within a pixel keep their slope, and casters see the same surface as the camera.

#include "lib/closure.glsl"

// `width`: pixels between the heights, which are in metres.
vec3 bumped_normal(SurfacePoint point, vec3 normal, float width, float height, float height_dx, float height_dy)
{
  vec3 across_x = cross(point.position_dy, normal);
  vec3 across_y = cross(normal, point.position_dx);
  float area = dot(point.position_dx, across_x);
  vec3 gradient = (height_dx - height) * across_x + (height_dy - height) * across_y;
  vec3 tilted = width * abs(area) * normal - sign(area) * gradient;
  // Scale-free: of a microscopic object even the square of this length may vanish.
  float size = max(max(abs(tilted.x), abs(tilted.y)), abs(tilted.z));
  return (size > 0.0) ? normalize(tilted / size) : normal;
}

void bump(SurfacePoint point, float strength, float distance, float width, bool invert, float height, float height_dx,
          float height_dy, vec3 normal, out vec3 result)
{
  float scale = invert ? -distance : distance;
  vec3 bumped = bumped_normal(point, normal, width, scale * height, scale * height_dx, scale * height_dy);
  float share = max(strength, 0.0);
  result = safe_normalize(share * bumped + (1.0 - share) * normal);
}

void displacement_along_normal(float height, float midlevel, float scale, vec3 normal, out vec3 displacement)
{
  displacement = normal * (height - midlevel) * scale;
}

void displacement_along_normal_of_object(SurfacePoint point, float height, float midlevel, float scale, vec3 normal,
                                         out vec3 displacement)
{
  displacement = world_from_object(point, object_from_world_normal(point, normal) * (height - midlevel) * scale);
}

void vector_displacement_world(vec3 vector, float midlevel, float scale, out vec3 displacement)
{
  displacement = (vector - vec3(midlevel)) * scale;
}

void vector_displacement_object(SurfacePoint point, vec3 vector, float midlevel, float scale, out vec3 displacement)
{
  displacement = world_from_object(point, (vector - vec3(midlevel)) * scale);
}

// Of the vector in tangent space, y is along the normal. `tangent` is in object space, the bitangent's sign in w.
void vector_displacement_tangent(SurfacePoint point, vec4 tangent, vec3 vector, float midlevel, float scale,
                                 out vec3 displacement)
{
  vec3 offset = (vector - vec3(midlevel)) * scale;
  vec3 normal = object_from_world_normal(point, point.normal);
  vec3 along = tangent.xyz;
  vec3 bitangent = tangent.w * safe_normalize(cross(normal, along));
  displacement = world_from_object(point, along * offset.x + normal * offset.y + bitangent * offset.z);
}

// The normal of a surface that is displaced by these vectors: what matters is how far they lift it off.
vec3 displaced_normal(SurfacePoint point, float width, vec3 here, vec3 moved_x, vec3 moved_y)
{
  return bumped_normal(point, point.normal, width, dot(here, point.normal), dot(moved_x, point.normal),
                       dot(moved_y, point.normal));
}

// The point where it was before its vertices were moved, of which two attributes hold place and normal in object space.
SurfacePoint point_before(SurfacePoint point, int place, int normal)
{
  SurfacePoint before = point;
  before.position = world_from_object(point, point.attributes[place].xyz) + object_place(point);
  before.position_dx = world_from_object(point, point.attributes_dx[place].xyz);
  before.position_dy = world_from_object(point, point.attributes_dy[place].xyz);
  vec3 turned = world_from_object_normal(point, point.attributes[normal].xyz);
  before.normal = (dot(turned, turned) > 0.5) ? (point.backfacing ? -turned : turned) : point.normal;
  return before;
}
