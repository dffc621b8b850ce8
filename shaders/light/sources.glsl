// Light sources as Cycles has them: where a sample of each lies for a receiver, how much it gives, and what a ray hits.
//
// The uniform block `sources` holds a record Light for each, declared in addon/sources/lights.py. Beside what stands there:
// of suns and directions `centre` is the unit vector towards the light and `radius` the half angle; `point` is the offset
// from the centre (point, spot), the position (area) or the direction (sun); `radiance` is radiant intensity where the
// radius is 0, radiance / density of a direction, whose `area` is its density.
#include "record/light.glsl"
#include "lib/math.glsl"
#ifdef HAS_LAMP_MAPS
#include "light/lamp_map.glsl"
#endif

// What the lights of a pass may be, as bits: each kind by its number, and lights as a whole (addon/sources/lights.py). What
// is left out some drivers would compute and mask.
#ifndef LIGHT_KINDS
#define LIGHT_KINDS -1
#endif
#define LIGHTS_HAVE(kind_number) ((LIGHT_KINDS & (1 << (kind_number))) != 0)
#define LIGHT_IS(light, number) (LIGHTS_HAVE(number) && (light).kind == (number))

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

// Least squared distance, m2, at which a light's point stands for its part of the light.
float light_least(Light light)
{
  return light_footprint(light) * (LIGHT_IS(light, LIGHT_SURFACE) ? light.area : 1.0);
}

// Falloff of a spot for a ray that leaves it along `direction`.
float spot_attenuation(Light light, vec3 direction)
{
  vec3 local = safe_normalize(
      vec3(dot(light_u(light), direction), dot(light_v(light), direction), dot(light_w(light), direction)));
  float inside = -local.z - light_cone(light);
  if (inside <= 0.0) {
    return 0.0;
  }
  float edge = light_edge(light);
  if (edge <= 0.0) {
    return 1.0;
  }
  float x = clamp(inside * edge, 0.0, 1.0);
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

// Where a ray from `position` towards the light meets the plane of an area light: distance, and place on it.
float light_plane(Light light, vec3 position, vec3 direction, out vec2 place)
{
  float t = dot(position - light.centre, light.axis) / max(-dot(direction, light.axis), 1e-6);
  vec3 offset = position + t * direction - light.centre;
  vec3 u = light_u(light);
  vec3 v = light_v(light);
  place = vec2(dot(offset, u) / max(dot(u, u), 1e-30), dot(offset, v) / max(dot(v, v), 1e-30));
  return t;
}

bool light_has_place(Light light, vec2 place)
{
  return (LIGHT_IS(light, LIGHT_RECTANGLE) ? max(abs(place.x), abs(place.y)) : length(place)) <= 1.0;
}

// The same of an area light that shines into a narrow cone: the direction is shared, and the point differs (LIGHT_NARROW).
vec3 light_sample_narrow(Light light, vec3 position, out vec3 direction, out float density)
{
  direction = light.point;
  vec2 place;
  float t = light_plane(light, position, direction, place);
  float cos_light = -dot(direction, light.axis);
  density = t * t / max(light.area * cos_light, 1e-30);  // as in light_hit
  if (t <= 0.0 || !light_has_place(light, place)) {
    return vec3(0.0);
  }
  // Drawn in proportion to the spread's attenuation (Emitter.narrow_sample), whose integral over tangents that is.
  float h = light.spread;
  float cone = PI / 3.0 * h * h * h * spread_attenuation(h, 1.0) / h;
  return light.radiance * light_tree(light, -direction, position + t * direction, t)
         * (cone * cos_light * cos_light * cos_light * cos_light);
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
  if ((LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE)) && (light.flags & LIGHT_NARROW) != 0) {
    return light_sample_narrow(light, position, direction, density);
  }
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE) || LIGHT_IS(light, LIGHT_SURFACE)) {
    vec3 to_light = light.point - position;
    float squared = max(dot(to_light, to_light), 1e-30);
    direction = to_light * inversesqrt(squared);
    float path = sqrt(squared);
    float cos_light = -dot(direction, light.axis);
    if (LIGHT_IS(light, LIGHT_SURFACE)) {
      cos_light = ((light.flags & LIGHT_SIDED) != 0) ? cos_light : abs(cos_light);
    }
    if (cos_light <= 0.0) {
      return vec3(0.0);
    }
    density = squared / max(light.area * cos_light, 1e-30);  // lobes know it, however near the light is
    float solid_angle = light.area * cos_light / max(squared, light_least(light));
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
      squared = max(squared, light_least(light));
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
  if ((LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE)) && (light.flags & LIGHT_NARROW) != 0) {
    vec2 place;
    return light_plane(light, origin, direction, place);
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
    vec3 u = light_u(light);
    vec3 v = light_v(light);
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
