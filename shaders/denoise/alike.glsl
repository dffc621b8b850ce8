// How much two pixels show the same surface, 0 to 1, the same seen from either: by the mean normals of all samples, and
// by the distance from each other's tangent plane, which may be some pixels for neighbours `stride` pixels apart. Programs
// have the constant `sharpness`, of the cosine between normals: 32 is half at 12 degrees, 8 at 24.
// OF_MEDIA: whether the air before what they show is as deep, and behind layers of the same colour.
#ifdef OF_MEDIA
struct Shown {
  float away;
  vec3 layers;
};

bool shown_at(ivec2 pixel, out Shown shown)
{
  vec4 position = surface_position_fetch(pixel);
  shown.away = (position.w != 0.0) ? distance(position.xyz, film_view.eye.xyz) : 1e18;
#ifdef HAS_VIEW_LAYERS
  shown.layers = view_layers_fetch(pixel).rgb;
#else
  shown.layers = vec3(1.0);
#endif
  return true;
}

float alike(Shown one, Shown other, int spacing)
{
  float most = max(one.away, other.away);
  float colored = max_component(abs(one.layers - other.layers));
  float deep = max(1.0 - 8.0 * abs(one.away - other.away) / (max(most, 1e-30) * float(spacing)), 0.0);
  return deep * max(1.0 - 8.0 * colored, 0.0);
}
#else
#include "neighbours/pixel_size.glsl"

struct Shown {
  vec3 position;
  vec3 normal;
  float pixel_size;
};

bool shown_at(ivec2 pixel, out Shown shown)
{
  vec4 position = surface_position_fetch(pixel);
  vec3 normal = normal_sum_fetch(pixel).xyz;
  float size = length(normal);
  shown.position = position.xyz;
  shown.normal = normal / max(size, 1e-30);
  shown.pixel_size = pixel_size_at(position.xyz);
  return position.w != 0.0 && size > 0.0;
}

float alike(Shown one, Shown other, int spacing)
{
  float turned = pow(max(dot(one.normal, other.normal), 0.0), sharpness);
  vec3 path = other.position - one.position;
  float off_plane = max(abs(dot(one.normal, path)), abs(dot(other.normal, path)));
  return turned * exp(-off_plane / (max(one.pixel_size, other.pixel_size) * 2.0 * float(spacing + 1)));
}
#endif
