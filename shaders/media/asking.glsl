// Light that would reach a place in media from a point of a row of lights, or from the world, if nothing were in its way;
// and places on a ray to ask it at.
#include "media/bins.glsl"
#include "light/sources.glsl"
#ifdef WORLD_LIT
#include "lib/environment.glsl"
#define ROWS_ASKED (light_count + 1)  // the last one is the world, by rays along the phase function
#else
#define ROWS_ASKED light_count
#endif

// How far inside a spot's cone, in its own space, a place of the ray is: negative outside.
float in_cone(vec3 start, vec3 way, float cosine, float t)
{
  vec3 place = start + t * way;
  return -place.z - cosine * length(place);
}

// The part of a ray that is in a spot's cone, of `apex`; it is one, as cones are convex.
void clip_to_cone(Light light, vec3 apex, vec3 origin, vec3 direction, inout float begin, inout float end)
{
  vec4 r0 = vec4(light_u(light), light_cone(light));
  vec3 r1 = light_v(light);
  vec3 r2 = light_w(light);
  vec3 offset = origin - apex;
  vec3 start = vec3(dot(r0.xyz, offset), dot(r1, offset), dot(r2, offset));
  vec3 way = vec3(dot(r0.xyz, direction), dot(r1, direction), dot(r2, direction));
  // Light leaves all of a round lamp: the cone around all of their cones begins behind it.
  start.z -= light.radius * length(r2) / sqrt(max(1.0 - r0.w * r0.w, 1e-6));
  float squared = r0.w * r0.w;
  float a = way.z * way.z - squared * dot(way, way);
  if (r0.w <= 0.0 || abs(a) < 1e-6 * dot(way, way)) {
    return;
  }
  float b = start.z * way.z - squared * dot(start, way);
  float root = b * b - a * (start.z * start.z - squared * dot(start, start));
  float low = (-b - sign(a) * sqrt(max(root, 0.0))) / a;
  float high = (-b + sign(a) * sqrt(max(root, 0.0))) / a;
  float apart = max(high - low, 1e-6 * max(abs(high), abs(low)));
  if (root > 0.0 && in_cone(start, way, r0.w, 0.5 * (low + high)) > 0.0) {
    begin = max(begin, low);
    end = min(end, high);
  }
  else if (root > 0.0 && in_cone(start, way, r0.w, high + apart) > 0.0) {
    begin = max(begin, high);
  }
  else if (root > 0.0 && in_cone(start, way, r0.w, low - apart) > 0.0) {
    end = min(end, low);
  }
  else {
    end = begin;
  }
}

// The lamp with another point of it than the one that all pixels share: neighbours together see more of a lamp than one.
Light light_at(Light light, vec2 u)
{
  if (LIGHT_IS(light, LIGHT_POINT) || LIGHT_IS(light, LIGHT_SPHERE)) {
    float z = 1.0 - 2.0 * u.x;
    float across = sqrt(max(1.0 - z * z, 0.0));
    light.point = length(light.point) * vec3(across * cos(2.0 * PI * u.y), across * sin(2.0 * PI * u.y), z);
  }
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE)) {
    vec2 place = LIGHT_IS(light, LIGHT_RECTANGLE) ? 2.0 * u - 1.0
                                                  : sqrt(u.x) * vec2(cos(2.0 * PI * u.y), sin(2.0 * PI * u.y));
    light.point = light.centre + place.x * light_u(light) + place.y * light_v(light);
  }
  return light;
}

#define LAMP_SHARE 0.6  // of a round lamp's radius: nearer to its middle its light grows little

// Places on a ray, in equal steps of the angle under which the point of a row sees it (Kulla & Fajardo 2012): between
// `begin` and `end`, where a spot shines, and before an area lamp. Those of rows at infinity do not exist.
struct Around {
  bool exists;
  bool round_lamp;  // around its middle, whichever point of it is asked
  float begin;
  float end;
  float middle;  // distance of the place nearest to the point
  float apart;   // its distance to the point, at least a share of a round lamp's radius
  float low;     // angles of begin and end
  float opening;
};

// `u`: what light_at is given.
Around around_row(int number, vec2 u, vec3 origin, vec3 direction, float begin, float end)
{
  Around around;
  bool far = true;
  vec3 point = origin;
  float size = 0.0;
  around.round_lamp = false;
  if (number >= 0 && number < light_count) {
    Light light = light_at(light_read(number), u);
    far = LIGHT_IS(light, LIGHT_SUN) || LIGHT_IS(light, LIGHT_DIRECTION);
    around.round_lamp = LIGHT_IS(light, LIGHT_POINT) || LIGHT_IS(light, LIGHT_SPHERE);
    point = around.round_lamp ? light.centre : light.point;
    size = around.round_lamp ? LAMP_SHARE * light.radius : 0.0;
    if ((light.flags & LIGHT_SPOT) != 0) {
      clip_to_cone(light, point, origin, direction, begin, end);
    }
    if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE)) {
      float along = dot(direction, light.axis);
      float plane = dot(point - origin, light.axis) / ((abs(along) > 1e-12) ? along : 1e-12);
      begin = (along > 0.0) ? max(begin, plane) : begin;
      end = (along > 0.0) ? end : min(end, plane);
    }
  }
  around.begin = begin;
  around.end = end;
  around.middle = dot(point - origin, direction);
  vec3 missed = origin + around.middle * direction - point;
  around.apart = max(sqrt(dot(missed, missed) + size * size), 1e-6 * max(abs(around.middle), 1e-3));
  around.low = atan((begin - around.middle) / around.apart);
  around.opening = atan((min(end, 1e15) - around.middle) / around.apart) - around.low;
  around.exists = !far && end > begin && around.opening > 1e-7;
  return around;
}

float around_draw(Around around, float u)
{
  return clamp(around.middle + around.apart * tan(around.low + u * around.opening), around.begin, around.end);
}

// Per metre.
float around_density(Around around, float t)
{
  if (t < around.begin || t > around.end) {
    return 0.0;
  }
  float off = t - around.middle;
  return around.apart / (around.opening * (off * off + around.apart * around.apart));
}

struct Asked {
  vec3 direction;
  float reach;
  bool shadow;
  bool glass_stops;  // what glass lets pass of it arrives as beams
  vec3 found;
};

Asked ask_nothing()
{
  Asked asked;
  asked.direction = vec3(0.0, 0.0, 1.0);
  asked.reach = 0.0;
  asked.shadow = false;
  asked.glass_stops = false;
  asked.found = vec3(0.0);
  return asked;
}

// A row of lights, before any phase function or cosine. `density`: per steradian.
Asked ask_light(Light light, vec3 position, vec2 u, out float density)
{
  Asked asked;
  light = light_at(light, u);
  asked.found = light_sample(light, position, asked.direction, density);
  asked.reach = light_distance(light, position, asked.direction);
  asked.shadow = (light.flags & LIGHT_SHADOW) != 0;
  asked.glass_stops = glass_blocks != 0 && light.kind < LIGHT_DIRECTION;
  return asked;
}

// Light of row `number` that media at a place scatter on along `onwards`, per metre.
Asked ask_scattered(int number, uint inside, vec3 position, vec3 onwards, vec2 u, uint salt)
{
#ifdef WORLD_LIT
  float g = media_lobe(inside, position, salt);
  if (number >= light_count) {
    Asked asked;
    asked.direction = -phase_direction(g, onwards, u);
    asked.reach = 1e29;
    asked.shadow = true;
    asked.glass_stops = false;
    float lobe = phase_henyey_greenstein(g, dot(-asked.direction, onwards));
    float rows = world_rows * environment_density(asked.direction);
    asked.found = environment_radiance(asked.direction) / max(rows + lobe, 1e-30);  // balance heuristic
    asked.found *= media_scattered(inside, position, -asked.direction, onwards, salt);
    return asked;
  }
#endif
  if (number < hidden_rows) {
    return ask_nothing();
  }
  Light light = light_read(number);
  float density;
  Asked asked = ask_light(light, position, u, density);
  asked.found *= media_scattered(inside, position, -asked.direction, onwards, salt);
#ifdef WORLD_LIT
  if (LIGHT_IS(light, LIGHT_DIRECTION)) {
    float lobe = phase_henyey_greenstein(g, dot(-asked.direction, onwards));
    asked.found *= world_rows * density / max(world_rows * density + lobe, 1e-30);
  }
#endif
  return asked;
}
