// Nodes that read the surface point or its attributes.

#include "lib/closure.glsl"
#include "lib/color.glsl"

void input_attribute(vec4 stored, out vec3 color, out vec3 vector, out float average, out float alpha)
{
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
  uv = vec3(stored.xy, 0.0);
}

void input_texture_coordinate(SurfacePoint point, vec4 uv_attribute, out vec3 uv, out vec3 reflection)
{
  uv = vec3(uv_attribute.xy, 0.0);
  reflection = 2.0 * dot(point.normal, point.incoming) * point.normal - point.incoming;
}

void input_geometry(SurfacePoint point, out vec3 normal, out vec3 true_normal, out vec3 incoming, out float backfacing)
{
  normal = point.normal;
  true_normal = point.geometric_normal;
  incoming = point.incoming;
  backfacing = point.backfacing ? 1.0 : 0.0;
}

void input_object_info(SurfacePoint point, out float random)
{
  random = point.object_random;
}

void input_color(vec3 chosen, out vec3 color)
{
  color = chosen;
}

void input_value(float chosen, out float value)
{
  value = chosen;
}

void input_tangent(vec4 stored, out vec3 tangent)
{
  tangent = stored.xyz;
}
