// Nodes that read the surface point, its object or its attributes.

#include "lib/closure.glsl"
#include "lib/color.glsl"
#include "material/values.glsl"

// An alpha of 2 marks coordinates of two dimensions, whose number is the first.
void input_attribute(vec4 stored, out vec3 color, out vec3 vector, out float average, out float alpha)
{
  color = stored.xyz;
  vector = stored.xyz;
  average = (stored.w > 1.5) ? stored.x : vector_average(stored.xyz);
  alpha = min(stored.w, 1.0);
}

// Of the object or its instancer. What belongs to no instance has none.
void input_instance_attribute(SurfacePoint point, float column, out vec3 color, out vec3 vector, out float average,
                              out float alpha)
{
#ifdef INSTANCE_IMAGE
  vec4 stored = instance_attribute(point.object_attributes, int(column + 0.5));
#else
  vec4 stored = vec4(0.0);
#endif
  color = stored.xyz;
  vector = stored.xyz;
  average = vector_average(stored.xyz);
  alpha = stored.w;
}

// Of the view layer, the scene or the world: the row where it stands.
void input_layer_attribute(int first, int rows, out vec3 color, out vec3 vector, out float average, out float alpha)
{
  vec4 stored = material_row(first, 0);
  color = stored.xyz;
  vector = stored.xyz;
  average = vector_average(stored.xyz);
  alpha = stored.w;
}

void input_color_attribute(vec4 stored, out vec3 color, out float alpha)
{
  color = stored.xyz;
  alpha = stored.w;
}

void input_uv(vec4 stored, out vec3 uv)
{
  uv = stored.xyz;  // of a map 0, but other attributes may be named, too
}

void input_instancer_uv(SurfacePoint point, out vec3 uv)
{
  uv = vec3(point.instancer_uv, 0.0);
}

// Camera space of node trees: x right, y up, z into the picture.
vec3 camera_space(vec3 difference)
{
  return vec3(dot(material_scene.camera_right.xyz, difference), dot(material_scene.camera_up.xyz, difference),
              -dot(material_scene.camera_backward.xyz, difference));
}

// Place in the picture, 0..1 from the lower left corner.
vec3 window_space(vec3 position)
{
  vec3 p = camera_space(position - material_scene.camera_position.xyz);
  float depth = (material_scene.origin.w > 0.5) ? 1.0 : p.z;
  vec2 plane = (depth != 0.0) ? p.xy / depth : vec2(0.0);
  return vec3((plane - material_scene.window.xy) / material_scene.window.zw, 0.0);
}

// What follows from the point alone; UV and Generated come from attributes.
void texture_coordinates(SurfacePoint point, out vec3 normal, out vec3 camera, out vec3 window, out vec3 reflection)
{
  normal = object_from_world_normal(point, point.normal);
  camera = camera_space(point.position - material_scene.camera_position.xyz);
  window = window_space(point.position);
  reflection = 2.0 * dot(point.normal, point.incoming) * point.normal - point.incoming;
}

void input_texture_coordinate(SurfacePoint point, vec4 generated_attribute, vec4 uv_attribute, out vec3 generated,
                              out vec3 normal, out vec3 uv, out vec3 object, out vec3 camera, out vec3 window,
                              out vec3 reflection)
{
  generated = generated_attribute.xyz;
  uv = vec3(uv_attribute.xy, 0.0);
  object = object_from_world(point, point.position - object_place(point));
  texture_coordinates(point, normal, camera, window, reflection);
}

void input_texture_coordinate_instancer(SurfacePoint point, out vec3 generated, out vec3 normal, out vec3 uv,
                                        out vec3 object, out vec3 camera, out vec3 window, out vec3 reflection)
{
  generated = point.instancer_generated;
  uv = vec3(point.instancer_uv, 0.0);
  object = object_from_world(point, point.position - object_place(point));
  texture_coordinates(point, normal, camera, window, reflection);
}

// Places as another object sees them: `first` is the row where its inverse matrix stands.
void input_texture_coordinate_object(SurfacePoint point, vec4 generated_attribute, vec4 uv_attribute, int first,
                                     int rows, out vec3 generated, out vec3 normal, out vec3 uv, out vec3 object,
                                     out vec3 camera, out vec3 window, out vec3 reflection)
{
  input_texture_coordinate(point, generated_attribute, uv_attribute, generated, normal, uv, object, camera, window,
                           reflection);
  vec4 place = vec4(point.position + material_scene.origin.xyz, 1.0);
  object = vec3(dot(material_row(first, 0), place), dot(material_row(first, 1), place),
                dot(material_row(first, 2), place));
}

// A direction of object space as a tangent: turned to world space and laid into the surface.
vec3 surface_tangent(SurfacePoint point, vec3 direction)
{
  vec3 turned = cross(world_from_object_normal(point, direction), point.normal);
  return cross(point.normal, safe_normalize(turned));
}

void input_geometry(SurfacePoint point, vec4 generated, vec4 shape, vec4 island, out vec3 position, out vec3 normal,
                    out vec3 tangent, out vec3 true_normal, out vec3 incoming, out vec3 parametric,
                    out float backfacing, out float pointiness, out float random_per_island)
{
  position = point.position + material_scene.origin.xyz;
  normal = point.normal;
  tangent = surface_tangent(point, vec3(0.5 - generated.y, generated.x - 0.5, 0.0));
  true_normal = point.geometric_normal;
  incoming = point.incoming;
  // Not known of triangles, whose corners are shared.
  parametric = (point.ray == RAY_LAMP) ? vec3(point.instancer_uv, 0.0) : vec3(0.0);
  backfacing = point.backfacing ? 1.0 : 0.0;
  pointiness = shape.x;
  random_per_island = island.x;
}

void input_object_info(SurfacePoint point, float material, out vec3 location, out vec3 color, out float alpha,
                       out float object_index, out float material_index, out float random)
{
  location = object_place(point) + material_scene.origin.xyz;
  color = point.object_color.rgb;
  alpha = point.object_color.a;
  object_index = point.object_index;
  material_index = material;
  random = point.object_random;
}

void input_camera(SurfacePoint point, out vec3 view, out float depth, out float distance)
{
  vec3 p = camera_space(point.position - material_scene.camera_position.xyz);
  view = safe_normalize(p);
  depth = p.z;
  distance = length(p);
}

// The camera looks at everything that is drawn, light asks casters for their transparency, and rays of lobes and through
// glass meet the rest (hits/): those all count as reflected.
void input_light_path(SurfacePoint point, out float camera_ray, out float shadow_ray, out float diffuse_ray,
                      out float glossy_ray, out float singular_ray, out float reflection_ray,
                      out float transmission_ray, out float volume_ray, out float ray_length, out float ray_depth,
                      out float diffuse_depth, out float glossy_depth, out float transparent_depth,
                      out float transmission_depth, out float portal_depth)
{
  camera_ray = (point.ray == RAY_CAMERA) ? 1.0 : 0.0;
  shadow_ray = (point.ray == RAY_SHADOW) ? 1.0 : 0.0;
  diffuse_ray = 0.0;
  glossy_ray = (point.ray == RAY_GLOSSY) ? 1.0 : 0.0;
  singular_ray = 0.0;
  reflection_ray = glossy_ray;
  transmission_ray = 0.0;
  volume_ray = 0.0;
  ray_length = length(point.position - material_scene.camera_position.xyz);
  ray_depth = shadow_ray;
  if (point.ray == RAY_LAMP) {  // as if light came after the first surface, by no kind of ray
    ray_length = point.instancer_generated.x;
    ray_depth = 1.0;
  }
  diffuse_depth = 0.0;
  glossy_depth = 0.0;
  transparent_depth = 0.0;
  transmission_depth = 0.0;
  portal_depth = 0.0;
}

// Light that falls off otherwise than with the square of its way. Infinitely far away is nowhere in particular.
void input_light_falloff(SurfacePoint point, float strength, float smoothness, out float with_square, out float with_distance,
                         out float with_nothing)
{
  float path = (point.ray == RAY_LAMP) ? point.instancer_generated.x :
                                         length(point.position - material_scene.camera_position.xyz);
  float squared = path * path;
  bool far = path > 1e18;
  float share = (smoothness > 0.0 && !far) ? squared / (smoothness + squared) : 1.0;
  with_square = strength * share;
  with_distance = strength * share * (far ? 1.0 : path);
  with_nothing = strength * share * (far ? 1.0 : squared);
}

// On strands alone: what addon/snapshot/strands.py stores with their corners. Elsewhere the first number is 0.
void input_strand(SurfacePoint point, vec4 strand, vec4 way, out float is_strand, out float intercept, out float extent,
                  out float thickness, out vec3 tangent_normal, out float random)
{
  is_strand = strand.x;
  intercept = strand.y;
  extent = strand.z;
  thickness = strand.w * strand.x;
  vec3 along = safe_normalize(world_from_object(point, way.xyz));
  tangent_normal = safe_normalize(point.incoming - along * dot(point.incoming, along)) * strand.x;
  random = way.w * strand.x;
}

void input_point(SurfacePoint point, vec4 place, vec4 mark, out vec3 position, out float radius, out float random)
{
  position = (world_from_object(point, place.xyz) + object_place(point) + material_scene.origin.xyz) * mark.x;
  radius = place.w * mark.x;
  random = mark.y;
}

// 1 within half of `size` of an edge of the triangle. `weights`: of its corners, in any order; elsewhere they are 0.
void input_wireframe(SurfacePoint point, vec4 weights, vec4 weights_dx, vec4 weights_dy, float size, bool in_pixels,
                     out float share)
{
  float step = length(point.position_dx);
  vec3 gradient = sqrt(weights_dx.xyz * weights_dx.xyz + weights_dy.xyz * weights_dy.xyz) / max(step, 1e-30);
  vec3 from_edges = abs(weights.xyz) / max(gradient, vec3(1e-30));
  float nearest = min(from_edges.x, min(from_edges.y, from_edges.z));
  bool triangle = weights.x + weights.y + weights.z > 0.5;
  // A pixel is as wide as both steps along the surface look on average: Cycles' choice.
  vec3 across = point.position_dx - dot(point.position_dx, point.incoming) * point.incoming;
  vec3 along = point.position_dy - dot(point.position_dy, point.incoming) * point.incoming;
  float unit = in_pixels ? 0.5 * (length(across) + length(along)) : 1.0;
  share = (triangle && nearest < 0.5 * size * unit) ? 1.0 : 0.0;
}

void input_color(vec3 chosen, out vec3 color)
{
  color = chosen;
}

void input_value(float chosen, out float value)
{
  value = chosen;
}

void input_tangent(SurfacePoint point, vec4 stored, out vec3 tangent)
{
  tangent = surface_tangent(point, stored.xyz);
}

void input_tangent_x(SurfacePoint point, vec4 generated, out vec3 tangent)
{
  tangent = surface_tangent(point, vec3(0.0, 0.5 - generated.z, generated.y - 0.5));
}

void input_tangent_y(SurfacePoint point, vec4 generated, out vec3 tangent)
{
  tangent = surface_tangent(point, vec3(0.5 - generated.z, 0.0, generated.x - 0.5));
}

void input_tangent_z(SurfacePoint point, vec4 generated, out vec3 tangent)
{
  tangent = surface_tangent(point, vec3(0.5 - generated.y, generated.x - 0.5, 0.0));
}

// Fraction that a smooth dielectric reflects; `eta` is the index of the far side over that of the near one.
float dielectric_reflectance(float cosine, float eta)
{
  float c = abs(cosine);
  float g = eta * eta - 1.0 + c * c;
  if (g <= 0.0) {
    return 1.0;
  }
  g = sqrt(g);
  float a = (g - c) / (g + c);
  float b = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
  return 0.5 * a * a * (1.0 + b * b);
}

void input_fresnel(SurfacePoint point, float ior, vec3 normal, out float reflectance)
{
  float eta = max(ior, 1e-5);
  reflectance = dielectric_reflectance(dot(point.incoming, normal), point.backfacing ? 1.0 / eta : eta);
}

void input_layer_weight(SurfacePoint point, float blend, vec3 normal, out float fresnel, out float facing)
{
  float cosine = dot(point.incoming, normal);
  float eta = max(1.0 - blend, 1e-5);
  fresnel = dielectric_reflectance(cosine, point.backfacing ? eta : 1.0 / eta);
  float share = abs(cosine);
  if (blend != 0.5) {
    float bounded = clamp(blend, 0.0, 1.0 - 1e-5);
    share = pow(share, (bounded < 0.5) ? 2.0 * bounded : 0.5 / (1.0 - bounded));
  }
  facing = 1.0 - share;
}
