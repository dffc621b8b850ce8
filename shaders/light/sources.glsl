// Light sources as Cycles has them: where a sample of each lies for a receiver, how much it gives, and what a ray hits.
//
// The uniform block `sources` (addon/sources/lights.py) holds LIGHT_TEXELS vec4 per light, in `light[]`:
//   0: kind, flags, first depth-map view, number of views
//   1: centre, radius                 (sun, direction: unit vector towards the light, half angle)
//   2: this sample's point            (point, spot: offset from the centre; area: position; sun: direction)
//      w: how many points of the light a sample of the picture has on average (addon/sources/rates.py)
//   3: radiance, area                 (radius 0: radiant intensity; direction: radiance / density, density;
//                                      point of an emissive surface: radiance, 1 / density)
//   4: emission axis (unit)           w: tan of the half spread, 0 = Lambertian
//   5: half width vector (area), or row 0 of the inverse spot matrix; w: cosine of the half cone
//   6: half height vector, or row 1;  w: 1 / ((1 - cosine) blend), 0 = hard edge
//   7: row 2;                         w: least squared distance at which the point stands for its part of the light
#include "lib/math.glsl"
#ifdef HAS_LAMP_MAPS
#include "light/lamp_map.glsl"
#endif

#define LIGHT_TEXELS 8
#define LIGHT_POINT 0
#define LIGHT_SPHERE 1
#define LIGHT_SUN 2
#define LIGHT_RECTANGLE 3
#define LIGHT_ELLIPSE 4
#define LIGHT_DIRECTION 5
#define LIGHT_SURFACE 6

#define LIGHT_DIFFUSE 1
#define LIGHT_GLOSSY 2
#define LIGHT_SHADOW 4
#define LIGHT_SPOT 8
#define LIGHT_CAMERA 16
#define LIGHT_TRACED 32  // rays of narrow lobes look for it (light/traced.frag.glsl)
#define LIGHT_TRANSMISSION 256
#define LIGHT_SIDED 512
#define LIGHT_EVEN 1024
#define LIGHT_GLASS_BLOCKS 2048
#define LIGHT_MAPPED 4096  // its node tree varies: factors of light/lamp_map.glsl
#define LIGHT_MAP_SHIFT 13  // the bits above are the number of its map

// What the lights of a pass may be, as bits: each kind by its number, and lights as a whole (addon/sources/lights.py). What
// is left out some drivers would compute and mask.
#ifndef LIGHT_KINDS
#define LIGHT_KINDS -1
#endif
#define LIGHTS_AS_A_WHOLE 8
#define LIGHTS_HAVE(kind_number) ((LIGHT_KINDS & (1 << (kind_number))) != 0)
#define LIGHT_IS(light, number) (LIGHTS_HAVE(number) && (light).kind == (number))

struct Light {
  int kind;
  int unlit;  // groups of receivers that it leaves out, a bit each
  int flags;
  int first_view;
  int view_count;
  vec3 centre;
  float radius;
  vec3 point;
  float rate;
  vec3 radiance;
  float area;
  vec3 axis;
  float spread;
  int base;
};

Light light_read(int index)
{
  Light light;
  light.base = index * LIGHT_TEXELS;
  vec4 a = sources.light[light.base];
  vec4 b = sources.light[light.base + 1];
  vec4 d = sources.light[light.base + 3];
  vec4 e = sources.light[light.base + 4];
  light.kind = int(a.x) & 15;
  light.unlit = int(a.x) >> 4;
  light.flags = int(a.y);
  light.first_view = int(a.z);
  light.view_count = int(a.w);
  light.centre = b.xyz;
  light.radius = b.w;
  vec4 c = sources.light[light.base + 2];
  light.point = c.xyz;
  light.rate = c.w;
  light.radiance = d.xyz;
  light.area = d.w;
  light.axis = e.xyz;
  light.spread = e.w;
  return light;
}

// What the node tree of a lamp makes of light that leaves it along `direction` (unit), from a place, and goes so far.
vec3 light_tree(Light light, vec3 direction, vec3 from, float path)
{
#ifdef HAS_LAMP_MAPS
  if ((light.flags & LIGHT_MAPPED) != 0) {
    return lamp_map(light.flags >> LIGHT_MAP_SHIFT, direction, from, path);
  }
#endif
  return vec3(1.0);
}

// Falloff of a spot for a ray that leaves it along `direction`.
float spot_attenuation(Light light, vec3 direction)
{
  vec4 r0 = sources.light[light.base + 5];
  vec4 r1 = sources.light[light.base + 6];
  vec4 r2 = sources.light[light.base + 7];
  vec3 local = safe_normalize(vec3(dot(r0.xyz, direction), dot(r1.xyz, direction), dot(r2.xyz, direction)));
  float inside = -local.z - r0.w;
  if (inside <= 0.0) {
    return 0.0;
  }
  if (r1.w <= 0.0) {
    return 1.0;
  }
  float x = clamp(inside * r1.w, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

// Narrowed emission of an area light, normalised to the flux of a Lambertian one. cos_light > 0.
float spread_attenuation(float tan_half, float cos_light)
{
  if (tan_half <= 0.0) {
    return 1.0;
  }
  float half_angle = atan(tan_half);
  float tan_theta = sqrt(max(1.0 - cos_light * cos_light, 0.0)) / max(cos_light, 1e-6);
  // tan h - h cancels for small h: its series there.
  float normalisation = (half_angle > 0.05) ? tan_half - half_angle : half_angle * half_angle * half_angle / 3.0;
  return max(tan_half - tan_theta, 0.0) / normalisation;
}

// Light from this sample's point: returns radiance x (solid angle the sample stands for); the receiver multiplies by
// f cos. `density` per steradian of choosing this direction, 0 for sources without extent.
vec3 light_sample(Light light, vec3 position, out vec3 direction, out float density)
{
  density = 0.0;
  direction = vec3(0.0, 0.0, 1.0);
  if (LIGHT_IS(light, LIGHT_DIRECTION)) {
    direction = light.centre;
    density = light.area;
    return light.radiance;
  }
  if (LIGHT_IS(light, LIGHT_SUN)) {
    direction = light.point;
    if (light.radius <= 0.0) {
      return light.radiance;
    }
    density = 1.0 / light.area;
    return light.radiance * (light.area * light_tree(light, -direction, vec3(0.0), 1.0));
  }
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE) || LIGHT_IS(light, LIGHT_SURFACE)) {
    vec3 to_light = light.point - position;
    float squared = max(dot(to_light, to_light), 1e-30);
    direction = to_light * inversesqrt(squared);
    float path = sqrt(squared);
    squared = max(squared, sources.light[light.base + 7].w);
    float cos_light = -dot(direction, light.axis);
    if (LIGHT_IS(light, LIGHT_SURFACE)) {
      cos_light = ((light.flags & LIGHT_SIDED) != 0) ? cos_light : abs(cos_light);
    }
    if (cos_light <= 0.0) {
      return vec3(0.0);
    }
    float solid_angle = light.area * cos_light / squared;
    density = 1.0 / max(solid_angle, 1e-30);
    vec3 radiance = light.radiance * light_tree(light, -direction, light.point, path);
    return radiance * (solid_angle * spread_attenuation(light.spread, cos_light));
  }
  if (!LIGHTS_HAVE(LIGHT_POINT) && !LIGHTS_HAVE(LIGHT_SPHERE)) {
    return vec3(0.0);
  }

  vec3 to_centre = light.centre - position;
  float distance_squared = max(dot(to_centre, to_centre), 1e-30);
  vec3 axis = to_centre * inversesqrt(distance_squared);
  vec3 result;
  vec3 from_light;
  float path = sqrt(distance_squared);
  if (light.radius <= 0.0) {
    direction = axis;
    result = light.radiance / distance_squared;
    from_light = -axis;
  }
  else {
    // The sample's offset is drawn in the ball such that its projection along any axis fills the disc evenly.
    vec3 across = light.point - axis * dot(light.point, axis);
    if (LIGHT_IS(light, LIGHT_SPHERE)) {
      float sin_squared = light.radius * light.radius / distance_squared;
      if (sin_squared >= 1.0) {
        direction = safe_normalize(light.point);
        density = 1.0 / (4.0 * PI);
        return light.radiance * (4.0 * PI * light_tree(light, -direction, light.centre + light.point, light.radius));
      }
      float one_minus_cos = sin_squared / (1.0 + sqrt(1.0 - sin_squared));
      float rho_squared = min(dot(across, across) / (light.radius * light.radius), 1.0);
      float cos_theta = 1.0 - rho_squared * one_minus_cos;
      float sin_theta = sqrt(max(1.0 - cos_theta * cos_theta, 0.0));
      direction = safe_normalize(axis * cos_theta + safe_normalize(across) * sin_theta);
      float solid_angle = 2.0 * PI * one_minus_cos;
      density = 1.0 / solid_angle;
      result = light.radiance * solid_angle;
      float along = dot(to_centre, direction);
      vec3 missed = to_centre - along * direction;
      path = along - sqrt(max(light.radius * light.radius - dot(missed, missed), 0.0));
    }
    else {
      vec3 to_point = to_centre + across;
      float squared = max(dot(to_point, to_point), 1e-30);
      direction = to_point * inversesqrt(squared);
      squared = max(squared, sources.light[light.base + 7].w);
      float solid_angle = light.area * max(dot(direction, axis), 0.0) / squared;
      density = 1.0 / max(solid_angle, 1e-30);
      result = light.radiance * solid_angle;
      path = length(to_point);
    }
    from_light = -direction;
  }
  if ((light.flags & LIGHT_SPOT) != 0) {
    result *= spot_attenuation(light, from_light);
  }
  return result * light_tree(light, from_light, position - path * from_light, path);
}

// Distance from `origin` to the point of a light that light_sample found in `direction`; 1e29 for lights at infinity.
float light_distance(Light light, vec3 origin, vec3 direction)
{
  if (LIGHT_IS(light, LIGHT_SUN) || LIGHT_IS(light, LIGHT_DIRECTION)) {
    return 1e29;
  }
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE) || LIGHT_IS(light, LIGHT_SURFACE)) {
    return length(light.point - origin);
  }
  if (!LIGHTS_HAVE(LIGHT_POINT) && !LIGHTS_HAVE(LIGHT_SPHERE)) {
    return 1e29;
  }
  vec3 to_centre = light.centre - origin;
  float along = dot(to_centre, direction);
  if (light.radius <= 0.0) {
    return length(to_centre);
  }
  if (LIGHT_IS(light, LIGHT_SPHERE)) {
    vec3 missed = to_centre - along * direction;
    float half_chord = sqrt(max(light.radius * light.radius - dot(missed, missed), 0.0));
    return (length(to_centre) < light.radius) ? along + half_chord : along - half_chord;
  }
  return dot(to_centre, to_centre) / max(along, 1e-6 * length(to_centre));  // a disc that faces the receiver
}

// What a ray sees of a light: radiance, distance (1e28 for suns, before the end of all rays) and the density that light_sample has for the
// direction. Zero radiance = missed.
vec3 light_hit(Light light, vec3 origin, vec3 direction, out float hit_distance, out float density)
{
  hit_distance = 1e28;
  density = 0.0;
  if (LIGHT_IS(light, LIGHT_SUN)) {
    // Within a cap its area is pi chord^2; near 1 float32 and drivers' cosines tell nothing.
    vec3 apart = direction - light.centre;
    if (light.radius <= 0.0 || PI * dot(apart, apart) > light.area) {
      return vec3(0.0);
    }
    density = 1.0 / light.area;
    return light.radiance * light_tree(light, -direction, vec3(0.0), 1.0);
  }
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE)) {
    float cos_light = -dot(direction, light.axis);
    if (cos_light <= 0.0) {
      return vec3(0.0);
    }
    float t = dot(origin - light.centre, light.axis) / cos_light;
    vec3 u = sources.light[light.base + 5].xyz;
    vec3 v = sources.light[light.base + 6].xyz;
    vec3 offset = origin + t * direction - light.centre;
    vec2 place = vec2(dot(offset, u) / max(dot(u, u), 1e-30), dot(offset, v) / max(dot(v, v), 1e-30));
    bool inside = LIGHT_IS(light, LIGHT_RECTANGLE) ? max(abs(place.x), abs(place.y)) <= 1.0 : dot(place, place) <= 1.0;
    if (t <= 0.0 || !inside) {
      return vec3(0.0);
    }
    hit_distance = t;
    density = t * t / max(light.area * cos_light, 1e-30);
    vec3 radiance = light.radiance * light_tree(light, -direction, origin + t * direction, t);
    return radiance * spread_attenuation(light.spread, cos_light);
  }
  if ((!LIGHTS_HAVE(LIGHT_POINT) && !LIGHTS_HAVE(LIGHT_SPHERE)) || LIGHT_IS(light, LIGHT_DIRECTION)
      || LIGHT_IS(light, LIGHT_SURFACE) || light.radius <= 0.0) {
    return vec3(0.0);
  }
  vec3 to_centre = light.centre - origin;
  float distance_squared = max(dot(to_centre, to_centre), 1e-30);
  float along = dot(to_centre, direction);
  if (LIGHT_IS(light, LIGHT_SPHERE)) {
    vec3 missed = to_centre - along * direction;  // of squares the difference would cancel for a small lamp far away
    float miss_squared = dot(missed, missed);
    float r_squared = light.radius * light.radius;
    bool within = distance_squared < r_squared;
    if (miss_squared > r_squared || (along <= 0.0 && !within)) {
      return vec3(0.0);
    }
    float half_chord = sqrt(r_squared - miss_squared);
    hit_distance = within ? along + half_chord : along - half_chord;
    float sin_squared = r_squared / distance_squared;
    density = within ? 1.0 / (4.0 * PI) : (1.0 + sqrt(1.0 - sin_squared)) / (2.0 * PI * sin_squared);
  }
  else {
    vec3 axis = to_centre * inversesqrt(distance_squared);
    float cos_light = dot(direction, axis);
    if (cos_light <= 0.0) {
      return vec3(0.0);
    }
    float t = sqrt(distance_squared) / cos_light;
    vec3 offset = origin + t * direction - light.centre;
    if (dot(offset, offset) > light.radius * light.radius) {
      return vec3(0.0);
    }
    hit_distance = t;
    density = t * t / max(light.area * cos_light, 1e-30);
  }
  // Within a spot's ball its cone does not count, as in Cycles.
  bool cone = (light.flags & LIGHT_SPOT) != 0
              && !(LIGHT_IS(light, LIGHT_SPHERE) && distance_squared < light.radius * light.radius);
  float attenuation = cone ? spot_attenuation(light, -direction) : 1.0;
  return light.radiance * (attenuation * light_tree(light, -direction, origin + hit_distance * direction, hit_distance));
}
