// What a material knows about the point that it shades. Filled by surface/point.glsl and hits/point.glsl, read by the nodes of material/.

#define RAY_CAMERA 0  // the viewer looks at the point
#define RAY_SHADOW 1  // light asks whether the point lets it pass
#define RAY_LIGHT 2   // a surface is lit by the point, which belongs to the world
#define RAY_GLOSSY 3  // a surface reflects the point, or bends the way to it
#define RAY_LAMP 4    // a lamp lights something: instancer_generated.x is how far, m, instancer_uv the place on the lamp

struct SurfacePoint {
  vec3 position;          // world space, metres, relative to the render origin
  vec3 normal;            // shading normal, unit, on the viewer's side
  vec3 mesh_normal;       // the shading normal before displacement turns it
  vec3 geometric_normal;  // unit, on the viewer's side
  vec3 incoming;          // unit, towards the viewer
  bool backfacing;
  int ray;                // RAY_*
  bool refracts;          // glass bends what it lets through; else that passes straight on
  vec4 object_row0;       // rows of the matrix from object to world space, relative to the render origin
  vec4 object_row1;
  vec4 object_row2;
  vec4 object_color;
  float object_random;
  float object_index;
  vec3 instancer_generated;  // where on its instancer an instance stands
  vec2 instancer_uv;
  int object_attributes;  // where the instance's attributes stand (lib/instance.glsl)
  vec4 attributes[8];
  // Along the surface, one pixel's width of the camera apart, in two directions at right angles: for bump mapping.
  vec3 position_dx;
  vec3 position_dy;
  vec4 attributes_dx[8];
  vec4 attributes_dy[8];
};

// The neighbour on the surface, `steps` pixels away. Normals and what belongs to the object stay.
SurfacePoint surface_point_moved(SurfacePoint point, vec2 steps)
{
  SurfacePoint moved = point;
  moved.position += steps.x * point.position_dx + steps.y * point.position_dy;
  for (int i = 0; i < 8; i++) {
    moved.attributes[i] += steps.x * point.attributes_dx[i] + steps.y * point.attributes_dy[i];
  }
  return moved;
}

// Cofactors of the object's matrix: its inverse is their transpose divided by the determinant.
mat3 object_cofactors(SurfacePoint point)
{
  vec3 a = point.object_row0.xyz;
  vec3 b = point.object_row1.xyz;
  vec3 c = point.object_row2.xyz;
  return mat3(cross(b, c), cross(c, a), cross(a, b));
}

// A direction or difference of places from world to object space; 0 for an object that is flattened.
vec3 object_from_world(SurfacePoint point, vec3 difference)
{
  mat3 cofactors = object_cofactors(point);
  float determinant = dot(point.object_row0.xyz, cofactors[0]);
  return (determinant != 0.0) ? (cofactors * difference) / determinant : vec3(0.0);
}

vec3 world_from_object(SurfacePoint point, vec3 direction)
{
  return vec3(dot(point.object_row0.xyz, direction), dot(point.object_row1.xyz, direction),
              dot(point.object_row2.xyz, direction));
}

vec3 object_place(SurfacePoint point)
{
  return vec3(point.object_row0.w, point.object_row1.w, point.object_row2.w);
}

// Normals keep to the surface, not to the direction: transposed and inverse transposed matrices.
vec3 object_from_world_normal(SurfacePoint point, vec3 normal)
{
  return safe_normalize(normal.x * point.object_row0.xyz + normal.y * point.object_row1.xyz
                        + normal.z * point.object_row2.xyz);
}

vec3 world_from_object_normal(SurfacePoint point, vec3 normal)
{
  vec3 turned = normal * object_cofactors(point);
  float determinant = dot(point.object_row0.xyz, cross(point.object_row1.xyz, point.object_row2.xyz));
  return safe_normalize((determinant < 0.0) ? -turned : turned);
}
