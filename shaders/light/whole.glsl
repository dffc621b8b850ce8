// A light as a whole, unblocked: its irradiance in closed form, and parts of it for what has no closed form.
//
// Polygons: Lambert, "Photometria", 1760: the sum over the edges of angle times the normal's part. Spheres partly below
// the horizon: Snyder, "Area light sources for real-time graphics", Microsoft MSR-TR-96-11, 1996. Ellipses count as
// polygons of 12 sides and equal area (error below 1e-3 of the irradiance at a distance of half the radius).
#include "light/sources.glsl"

#define LIGHT_WHOLE 64  // the light is not sampled by a point: it counts as a whole
#define ELLIPSE_SIDES 12
#define WHOLE_PARTS 4

vec3 whole_corner(Light light, int k)
{
  vec3 u = sources.light[light.base + 5].xyz;
  vec3 v = sources.light[light.base + 6].xyz;
  if (light.kind == LIGHT_RECTANGLE) {
    return light.centre + ((k == 0 || k == 3) ? -u : u) + ((k < 2) ? -v : v);
  }
  float turn = 2.0 * PI / float(ELLIPSE_SIDES);
  float radius = sqrt(turn / sin(turn));
  return light.centre + radius * (cos(turn * float(k)) * u + sin(turn * float(k)) * v);
}

// Angle between unit vectors times the part along `normal` of the unit normal of their plane.
float edge_term(vec3 a, vec3 b, vec3 normal)
{
  vec3 across = cross(a, b);
  float sine = length(across);
  float angle = atan(sine, dot(a, b));
  return (sine > 1e-12) ? dot(across, normal) * (angle / sine) : 0.0;
}

// Projected solid angle of an area light above the horizon of `normal`.
float whole_polygon(Light light, vec3 position, vec3 normal)
{
  if (dot(position - light.centre, light.axis) <= 0.0) {
    return 0.0;
  }
  int sides = (light.kind == LIGHT_RECTANGLE) ? 4 : ELLIPSE_SIDES;
  float sum = 0.0;
  vec3 leaves = vec3(0.0);
  vec3 enters = vec3(0.0);
  bool cut = false;
  vec3 a = whole_corner(light, 0) - position;
  for (int k = 0; k < sides; k++) {
    vec3 next = whole_corner(light, (k + 1 == sides) ? 0 : k + 1) - position;
    vec3 b = next;
    float height_a = dot(a, normal);
    float height_b = dot(b, normal);
    if (height_a > 0.0 || height_b > 0.0) {
      if (height_a <= 0.0 || height_b <= 0.0) {
        vec3 crossing = mix(a, b, height_a / (height_a - height_b));
        cut = true;
        if (height_a <= 0.0) {
          enters = crossing;
          a = crossing;
        }
        else {
          leaves = crossing;
          b = crossing;
        }
      }
      sum += edge_term(safe_normalize(a), safe_normalize(b), normal);
    }
    a = next;
  }
  if (cut) {
    sum += edge_term(safe_normalize(leaves), safe_normalize(enters), normal);
  }
  return 0.5 * abs(sum);
}

// Projected solid angle of a cone of directions with the given sine around a unit axis.
float whole_cone(float sine, float cosine)
{
  float squared = sine * sine;
  if (cosine >= sine) {
    return PI * squared * cosine;
  }
  if (cosine <= -sine) {
    return 0.0;
  }
  float sin_theta = sqrt(max(1.0 - cosine * cosine, 1e-12));
  float x = sqrt(max(1.0 / squared - 1.0, 1e-12));
  float y = clamp(-x * cosine / sin_theta, -1.0, 1.0);
  float z = sin_theta * sqrt(1.0 - y * y);
  return max((cosine * acos(y) - x * z) * squared + atan(z / x), 0.0);
}

// Irradiance of the unblocked light. `direction`: towards its middle.
vec3 whole_irradiance(Light light, vec3 position, vec3 normal, vec3 direction)
{
  if (light.kind == LIGHT_RECTANGLE || light.kind == LIGHT_ELLIPSE) {
    float cos_light = -dot(direction, light.axis);
    float spread = (cos_light > 0.0) ? spread_attenuation(light.spread, cos_light) : 0.0;
    return light.radiance * (whole_polygon(light, position, normal) * ((light.spread > 0.0) ? spread : 1.0));
  }
  if (light.kind == LIGHT_SUN) {
    return light.radiance * whole_cone(sin(min(light.radius, 0.5 * PI)), dot(normal, light.centre));
  }
  vec3 to_centre = light.centre - position;
  float distance_squared = max(dot(to_centre, to_centre), 1e-30);
  float radius_squared = light.radius * light.radius;
  float attenuation = ((light.flags & LIGHT_SPOT) != 0) ? spot_attenuation(light, -direction) : 1.0;
  if (light.kind == LIGHT_SPHERE) {
    if (radius_squared >= distance_squared) {
      return light.radiance * (PI * attenuation);
    }
    return light.radiance * (attenuation * whole_cone(sqrt(radius_squared / distance_squared), dot(normal, direction)));
  }
  float sine = sqrt(radius_squared / (radius_squared + distance_squared));
  return light.radiance * (attenuation * whole_cone(sine, dot(normal, direction)));
}

// One of WHOLE_PARTS points that share the light: the Gauss points of two by two.
Light whole_part(Light light, int k, vec3 position)
{
  vec2 place = 0.57735 * vec2(float(k % 2) * 2.0 - 1.0, float(k / 2) * 2.0 - 1.0);
  light.radiance /= float(WHOLE_PARTS);
  if (light.kind == LIGHT_RECTANGLE || light.kind == LIGHT_ELLIPSE) {
    place *= (light.kind == LIGHT_ELLIPSE) ? 0.866 : 1.0;  // discs: the same second moments
    light.point = light.centre + place.x * sources.light[light.base + 5].xyz + place.y * sources.light[light.base + 6].xyz;
    return light;
  }
  vec3 axis = (light.kind == LIGHT_SUN) ? light.centre : safe_normalize(light.centre - position);
  vec3 u;
  vec3 v;
  orthonormal_basis(axis, u, v);
  vec3 offset = 0.866 * (place.x * u + place.y * v);
  light.point = (light.kind == LIGHT_SUN) ? safe_normalize(axis + offset * tan(min(light.radius, 1.5))) :
                                            offset * light.radius;
  return light;
}
