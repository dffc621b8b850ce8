// Places in the light of a lamp, drawn along rays that leave it, for a place that they send light on to.
//
// A ray is drawn from the lamp, evenly within its cone; on it a place, in equal steps of the angle under which the asking
// place sees the ray. The light there falls with the squared distance to the lamp and what comes of it with that to the
// asking place: both cancel in this density, but for places that the ray nearly meets, which the phase function finds.
#include "media/asking.glsl"

struct LampRays {
  bool exist;  // to places in media; none of a row that lights surfaces alone
  vec3 apex;  // where all rays begin; behind a round lamp with a cone
  bool shadow;
  vec3 source;  // a point of the lamp, from where what it lights is looked for
  vec3 face;    // normal of the mesh there; 0: no mesh
  vec3 axis;
  float cosine;  // of the cone; -1: everywhere; 0: by the cosine, before an area lamp
  bool by_cosine;
  float wide;  // share of rays that go anywhere: fog beside a lamp or its cone is lit by the fog in it
};

LampRays lamp_rays(int number, vec2 u)
{
  LampRays rays;
  rays.exist = false;
  rays.apex = vec3(0.0);
  rays.axis = vec3(0.0, 0.0, 1.0);
  rays.cosine = -1.0;
  rays.by_cosine = false;
  rays.wide = 0.0;
  rays.shadow = false;
  rays.source = vec3(0.0);
  rays.face = vec3(0.0);
  if (number < 0 || number >= light_count) {
    return rays;
  }
  Light light = light_at(light_read(number), u);
  bool near = !(LIGHT_IS(light, LIGHT_SUN) || LIGHT_IS(light, LIGHT_DIRECTION));
  rays.exist = near && number >= hidden_rows;
  bool round_lamp = LIGHT_IS(light, LIGHT_POINT) || LIGHT_IS(light, LIGHT_SPHERE);
  rays.apex = round_lamp ? light.centre : light.point;
  rays.source = round_lamp ? light.centre + light.point : light.point;
  rays.face = LIGHT_IS(light, LIGHT_SURFACE) ? light.axis : vec3(0.0);
  rays.shadow = near && (light.flags & LIGHT_SHADOW) != 0;
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE)) {
    rays.axis = light.axis;
    rays.by_cosine = true;
  }
  if ((light.flags & LIGHT_SPOT) != 0) {
    vec4 r0 = vec4(light_u(light), light_cone(light));
    vec3 r1 = light_v(light);
    vec3 r2 = light_w(light);
    float size = dot(r2, r2);
    // The cone of one that is stretched sideways is not round.
    bool even = abs(dot(r0.xyz, r0.xyz) - size) < 1e-3 * size && abs(dot(r1, r1) - size) < 1e-3 * size;
    if (even && r0.w > 0.0) {
      rays.axis = -r2 * inversesqrt(size);
      rays.cosine = r0.w;
      rays.apex -= rays.axis * light.radius * inversesqrt(max(1.0 - r0.w * r0.w, 1e-6));
    }
  }
  return rays;
}

// Density per steradian with which a ray is drawn.
float lamp_rays_share(LampRays rays, vec3 way)
{
  float cosine = dot(way, rays.axis);
  float within = (cosine >= rays.cosine) ? 1.0 / (2.0 * PI * (1.0 - rays.cosine)) : 0.0;
  return mix(rays.by_cosine ? max(cosine, 0.0) / PI : within, 0.25 / PI, rays.wide);
}

vec3 lamp_rays_way(LampRays rays, vec2 u)
{
  bool anywhere = u.x < rays.wide;
  float x = anywhere ? u.x / rays.wide : (u.x - rays.wide) / (1.0 - rays.wide);
  float cosine = anywhere ? 1.0 - 2.0 * x : (rays.by_cosine ? sqrt(1.0 - x) : mix(1.0, rays.cosine, x));
  float across = sqrt(max(1.0 - cosine * cosine, 0.0));
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(rays.axis, tangent, bitangent);
  return cosine * rays.axis + across * (cos(2.0 * PI * u.y) * tangent + sin(2.0 * PI * u.y) * bitangent);
}

// Density per steradian and metre, seen from `position`, with which lamp_rays_draw finds the place at `t` along a direction.
float lamp_rays_density(LampRays rays, vec3 position, vec3 direction, float t)
{
  vec3 from_apex = position + t * direction - rays.apex;
  float squared = max(dot(from_apex, from_apex), 1e-30);
  vec3 way = from_apex * inversesqrt(squared);
  vec3 offset = position - rays.apex;
  float middle = dot(offset, way);
  float apart = max(length(offset - middle * way), 1e-6 * length(offset) + 1e-20);
  return lamp_rays_share(rays, way) * apart / ((0.5 * PI + atan(middle / apart)) * squared);
}

// The place relative to `position`.
vec3 lamp_rays_draw(LampRays rays, vec3 position, vec3 u)
{
  vec3 way = lamp_rays_way(rays, u.xy);
  vec3 offset = position - rays.apex;
  float middle = dot(offset, way);
  float apart = max(length(offset - middle * way), 1e-6 * length(offset) + 1e-20);
  float low = -atan(middle / apart);
  float along = middle + apart * tan(mix(low, 0.5 * PI, min(u.z, 0.999999)));
  return max(along, 0.0) * way - offset;
}

// Places on a ray in proportion to one over their distance to a lamp, as light that has been scattered near it falls off.
struct Near {
  bool exist;
  float begin;
  float end;
  float middle;
  float apart;
  float low;
  float range;
};

float area_sine(float x)
{
  return sign(x) * log(abs(x) + sqrt(x * x + 1.0));
}

Near near_lamp(LampRays rays, int number, vec3 origin, vec3 direction, float begin, float end)
{
  Near near;
  near.exist = rays.exist && end > begin;
  vec3 point = rays.apex;
  float size = 0.0;
  if (near.exist) {
    Light light = light_read(number);
    bool round_lamp = LIGHT_IS(light, LIGHT_POINT) || LIGHT_IS(light, LIGHT_SPHERE);
    point = round_lamp ? light.centre : point;
    size = round_lamp ? LAMP_SHARE * light.radius : 0.0;
  }
  near.middle = dot(point - origin, direction);
  vec3 missed = origin + near.middle * direction - point;
  near.apart = max(sqrt(dot(missed, missed) + size * size), 1e-6 * max(abs(near.middle), 1e-3));
  near.begin = begin;
  near.end = end;
  near.low = area_sine((begin - near.middle) / near.apart);
  near.range = area_sine((end - near.middle) / near.apart) - near.low;
  near.exist = near.exist && near.range > 1e-6;
  return near;
}

float near_draw(Near near, float u)
{
  float x = near.low + u * near.range;
  return clamp(near.middle + near.apart * 0.5 * (exp(x) - exp(-x)), near.begin, near.end);
}

// Per metre.
float near_density(Near near, float t)
{
  if (t < near.begin || t > near.end) {
    return 0.0;
  }
  float off = t - near.middle;
  return 1.0 / (near.range * sqrt(off * off + near.apart * near.apart));
}
