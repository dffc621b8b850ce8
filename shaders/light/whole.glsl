// A light as a whole, unblocked: its irradiance in closed form, and parts of it for what has no closed form.
//
// Polygons: Lambert, "Photometria", 1760: the sum over the edges of angle times the normal's part. Spheres partly below
// the horizon: Snyder, "Area light sources for real-time graphics", Microsoft MSR-TR-96-11, 1996. Ellipses count as
// polygons of 12 sides and equal area (error below 1e-3 of the irradiance at a distance of half the radius).
#include "light/sources.glsl"

#define ELLIPSE_SIDES 12
#define WHOLE_PARTS 4

// From the light's centre.
vec3 whole_corner(Light light, int k)
{
  vec3 u = light_u(light);
  vec3 v = light_v(light);
  if (LIGHT_IS(light, LIGHT_RECTANGLE)) {
    return ((k == 0 || k == 3) ? -u : u) + ((k < 2) ? -v : v);
  }
  float turn = 2.0 * PI / float(ELLIPSE_SIDES);
  float radius = sqrt(turn / sin(turn));
  return radius * (cos(turn * float(k)) * u + sin(turn * float(k)) * v);
}

// Angle that an edge from `a` is seen under, times the part along `normal` of the unit normal of the plane through it and
// the receiver. The quotient of an acute angle and its sine is a rational function of its cosine, by our own fit (relative
// error 6e-7); for a light far away, where the terms nearly cancel, it is the same for all of them, and so that they cancel
// to float32's relative precision the product is taken with the edge, not with the direction of its end.
float edge_term(vec3 a, vec3 edge, vec3 normal)
{
  vec3 b = a + edge;
  float scale = inversesqrt(max(dot(a, a), 1e-30)) * inversesqrt(max(dot(b, b), 1e-30));
  vec3 across = cross(a, edge) * scale;
  float cosine = dot(a, b) * scale;
  float x = min(abs(cosine), 1.0);
  float acute = (1.57079545 + (0.90580899 + 0.02603178 * x) * x) / (1.0 + (1.21323599 + 0.28939883 * x) * x);
  float quotient = (cosine >= 0.0) ? acute : PI * inversesqrt(max(dot(across, across), 1e-24)) - acute;
  return dot(across, normal) * quotient;
}

// Projected solid angle of an area light above the horizon of `normal`.
float whole_polygon(Light light, vec3 position, vec3 normal)
{
  if (dot(position - light.centre, light.axis) <= 0.0) {
    return 0.0;
  }
  int sides = LIGHT_IS(light, LIGHT_RECTANGLE) ? 4 : ELLIPSE_SIDES;
  vec3 middle = light.centre - position;
  float sum = 0.0;
  int above = 0;
  vec3 a = whole_corner(light, 0);
  for (int k = 1; k <= sides; k++) {
    vec3 b = whole_corner(light, (k == sides) ? 0 : k);
    sum += edge_term(middle + a, b - a, normal);
    above += (dot(middle + b, normal) > 0.0) ? 1 : 0;
    a = b;
  }
  if (above == 0) {
    return 0.0;
  }
  // Few lights are cut by the horizon; a loop without turns costs one where branches are masked.
  int cut_sides = (above < sides) ? sides : 0;
  sum = (above < sides) ? 0.0 : sum;
  vec3 leaves = middle;
  vec3 enters = middle;
  for (int k = 1; k <= cut_sides; k++) {
    vec3 b = whole_corner(light, (k == sides) ? 0 : k);
    vec3 from = middle + a;
    vec3 edge = b - a;
    float height_a = dot(from, normal);
    float height_b = dot(middle + b, normal);
    if (height_a > 0.0 || height_b > 0.0) {
      if (height_a <= 0.0 || height_b <= 0.0) {
        float share = height_a / (height_a - height_b);
        vec3 crossing = from + share * edge;
        if (height_a <= 0.0) {
          enters = crossing;
          from = crossing;
          edge *= 1.0 - share;
        }
        else {
          leaves = crossing;
          edge *= share;
        }
      }
      sum += edge_term(from, edge, normal);
    }
    a = b;
  }
  return 0.5 * abs(sum + ((cut_sides > 0) ? edge_term(leaves, enters - leaves, normal) : 0.0));
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
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE)) {
    float cos_light = -dot(direction, light.axis);
    float spread = (cos_light > 0.0) ? spread_attenuation(light.spread, cos_light) : 0.0;
    return light.radiance * (whole_polygon(light, position, normal) * ((light.spread > 0.0) ? spread : 1.0));
  }
  if (LIGHT_IS(light, LIGHT_SUN)) {
    return light.radiance * whole_cone(sin(min(light.radius, 0.5 * PI)), dot(normal, light.centre));
  }
  vec3 to_centre = light.centre - position;
  float distance_squared = max(dot(to_centre, to_centre), 1e-30);
  float radius_squared = light.radius * light.radius;
  float attenuation = ((light.flags & LIGHT_SPOT) != 0) ? spot_attenuation(light, -direction) : 1.0;
  if (LIGHT_IS(light, LIGHT_SPHERE)) {
    if (radius_squared >= distance_squared) {
      return light.radiance * PI;  // its cone does not count there
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
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE)) {
    place *= LIGHT_IS(light, LIGHT_ELLIPSE) ? 0.866 : 1.0;  // discs: the same second moments
    light.point = light.centre + place.x * light_u(light) + place.y * light_v(light);
    return light;
  }
  vec3 axis = LIGHT_IS(light, LIGHT_SUN) ? light.centre : safe_normalize(light.centre - position);
  vec3 u;
  vec3 v;
  orthonormal_basis(axis, u, v);
  vec3 offset = 0.866 * (place.x * u + place.y * v);
  light.point = LIGHT_IS(light, LIGHT_SUN) ? safe_normalize(axis + offset * tan(min(light.radius, 1.5))) :
                                            offset * light.radius;
  return light;
}
