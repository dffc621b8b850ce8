// How much two pixels show the same surface, 0 to 1: by the mean normals of all samples, and by the distance from the
// tangent plane, which may be some pixels for neighbours that are `stride` pixels apart.
#include "neighbours/pixel_size.glsl"

const float SHARPNESS = 32.0;  // of the cosine between normals: half at 12 degrees

struct Shown {
  vec3 position;
  vec3 normal;
};

bool shown_at(ivec2 pixel, out Shown shown)
{
  vec4 position = texelFetch(surface_position, pixel, 0);
  vec3 normal = texelFetch(normal_sum, pixel, 0).xyz;
  float size = length(normal);
  shown = Shown(position.xyz, normal / max(size, 1e-30));
  return position.w != 0.0 && size > 0.0;
}

float alike(Shown one, Shown other, float pixel_size, int stride)
{
  float turned = pow(max(dot(one.normal, other.normal), 0.0), SHARPNESS);
  float off_plane = abs(dot(one.normal, other.position - one.position));
  return turned * exp(-off_plane / (2.0 * pixel_size * float(stride + 1)));
}
