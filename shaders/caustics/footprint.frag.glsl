// Footprints of photons: the ellipse that a photon's neighbours on the grid span about it (addon/lighting/photons.py), as
// records of addon/kernels/splats.py, with where it came from and what takes it (caustics/arrival.glsl) in w of the centre.
// w of the others: the wall that the footprint ends at (wall_in), by direction and distance in the ellipse; beyond it: none.
// `film_view`: the view into which they will be drawn.
//
// WALLS: around photons of which others within the footprint end on other surfaces, rays along theirs look for walls.
#include "ask/view.glsl"
#include "lib/math.glsl"
#define NO_WALL vec3(1.0, 0.0, 2.0)
#ifdef WALLS
#define OPAQUE_ONLY
#include "trace/rays.glsl"

#define WALL_RAYS 8
#define LIFT 0.02     // of the shorter half axis, by which they run above the surface
#define MOST_APART 16.0  // texels, of a photon whose end says whether there may be walls within a wide footprint
#define FARTHER 1.42  // times the ellipse, how far they look: of the two nearest a wall's direction each meets it there
#define ALIKE 0.7     // cosine from which two walls may be one, of which distances differ by what it lacks
#define UPRIGHT 0.7   // cosine to the surface's normal up to which what they meet is no part of it

// What stands upright on an ellipse's surface at an angle about its centre, as a plane where the half axes are 1: unit
// direction, and distance as z.
vec3 wall_at(float angle, vec3 origin, vec3 normal, vec3 first, vec3 second)
{
  vec3 way = cos(angle) * first + sin(angle) * second;
  float unit = length(way);
  float reach = FARTHER * unit;
  ivec2 hit;
  float t = trace_until(origin, way / max(unit, 1e-30), reach, 0.0, 0u, hit);
  if (t >= reach) {
    return NO_WALL;
  }
  vec3 facing = triangle_normal(hit);
  vec2 across = vec2(dot(facing, first), dot(facing, second));
  float off = dot(facing, way) * t / unit;
  float size = length(across);
  bool upright = abs(dot(facing, normal)) < UPRIGHT && size > 0.0;
  return upright ? vec3((off < 0.0 ? -across : across) / size, abs(off) / size) : NO_WALL;
}

// The nearest wall within an ellipse that two neighbouring rays meet: what one alone meets, as a table's leg, is narrow.
vec3 wall_in(vec3 centre, vec3 normal, vec3 first, vec3 second)
{
  vec3 wall = NO_WALL;
  vec3 origin = centre + normal * (ray_offset(centre) + LIFT * length(second));
  vec3 met_first = NO_WALL;
  vec3 before = NO_WALL;
  for (int k = 0; k <= WALL_RAYS; k++) {
    vec3 met = met_first;
    if (k < WALL_RAYS) {
      met = wall_at(2.0 * PI * (float(k) + 0.5) / float(WALL_RAYS), origin, normal, first, second);
    }
    met_first = (k == 0) ? met : met_first;
    bool alike = dot(met.xy, before.xy) > ALIKE && abs(met.z - before.z) < 1.0 - ALIKE;
    vec3 nearer = (met.z < before.z) ? met : before;
    wall = (alike && nearer.z < wall.z) ? nearer : wall;
    before = met;
  }
  return wall;
}
#endif

bool is_alike(ivec2 other, float path, vec3 normal)
{
  return photon_points_fetch(other).w == path && dot(octahedral_decode(photon_normals_fetch(other).xy), normal) > 0.7;
}

#ifdef WALLS
// Whether one of the photons `apart` texels away ends on another surface.
bool is_torn(ivec2 texel, int apart, float path, vec3 normal)
{
  ivec2 last = photon_points_size() - 1;
  bool torn = false;
  for (int k = 0; k < 9; k++) {
    ivec2 other = clamp(texel + apart * (ivec2(k % 3, k / 3) - 1), ivec2(0), last);
    torn = torn || (photon_points_fetch(other).w > 0.0 && !is_alike(other, path, normal));
  }
  return torn;
}
#endif

// Adds the ways to two neighbours along one axis of the grid to the ellipse; false where neither is of the same bundle.
bool add_neighbours(ivec2 texel, ivec2 step, vec3 centre, float path, vec3 normal, float spacing, vec3 tangent,
                    vec3 bitangent, inout vec3 ellipse)
{
  vec3 sum = vec3(0.0);
  float count = 0.0;
  ivec2 size = photon_points_size();
  for (int k = -1; k <= 1; k += 2) {
    ivec2 other = texel + k * step;
    if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, size))) {
      continue;
    }
    vec4 there = photon_points_fetch(other);
    vec3 way = there.xyz - centre;
    float reach = length(way);
    if (is_alike(other, path, normal) && reach < longest * spacing) {
      // On a curved receiver the way is as long as it is, not as the tangent plane shows it.
      vec2 flat_way = vec2(dot(way, tangent), dot(way, bitangent));
      flat_way *= reach / max(length(flat_way), 1e-30);
      sum += vec3(flat_way.x * flat_way.x, flat_way.x * flat_way.y, flat_way.y * flat_way.y);
      count += 1.0;
    }
  }
  ellipse += sum / max(count, 1.0);
  return count > 0.0;
}

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 point = photon_points_fetch(texel);
  vec4 facing = photon_normals_fetch(texel);
  vec3 normal = octahedral_decode(facing.xy);
  vec4 flux = photon_fluxes_fetch(texel);
  out_centre = vec4(0.0);
  out_first = vec4(0.0);
  out_second = vec4(0.0);
  out_value = vec4(0.0);
  if (point.w <= 0.0 || !is_finite(dot(flux, vec4(1.0))) || !is_finite(dot(point, vec4(1.0)))) {
    return;
  }
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  vec3 ellipse = vec3(0.0);  // xx, xy, yy
  bool along_x = add_neighbours(texel, ivec2(1, 0), point.xyz, point.w, normal, flux.w, tangent, bitangent, ellipse);
  bool along_y = add_neighbours(texel, ivec2(0, 1), point.xyz, point.w, normal, flux.w, tangent, bitangent, ellipse);
  float alone = float(!along_x) + float(!along_y);
  ellipse += vec3(1.0, 0.0, 1.0) * (0.5 * alone * flux.w * flux.w);
  float apart = 0.5 * (ellipse.x + ellipse.z);  // of neighbours, squared
  ellipse *= widening * widening;
  float pixel = view_pixel() * view_growth_ahead(point.xyz);
  // The biweight kernel of radius h has the variance h^2 / 8, a disc of radius r r^2 / 4.
  float least = least_pixels * least_pixels * pixel * pixel + 2.0 * facing.w * facing.w;
  ellipse += vec3(least, 0.0, least);

  // Half axes: the roots of the ellipse's eigenvalues along its eigenvectors.
  float middle = 0.5 * (ellipse.x + ellipse.z);
  float half_gap = sqrt(max(0.25 * (ellipse.x - ellipse.z) * (ellipse.x - ellipse.z) + ellipse.y * ellipse.y, 0.0));
  float larger = middle + half_gap;
  float smaller = max((ellipse.x * ellipse.z - ellipse.y * ellipse.y) / max(larger, 1e-37), 1e-6 * larger);
  vec2 main_axis = (abs(ellipse.y) > 1e-6 * larger) ? normalize(vec2(larger - ellipse.z, ellipse.y))
                 : ((ellipse.x >= ellipse.z) ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
  vec3 first = main_axis.x * tangent + main_axis.y * bitangent;
  vec3 second = cross(normal, first) * sqrt(smaller);
  first *= sqrt(larger);
  vec3 wall = NO_WALL;
#ifdef WALLS
  int steps = int(clamp(sqrt(larger / max(apart, 1e-37)), 1.0, MOST_APART));
  if (is_torn(texel, 1, point.w, normal) || is_torn(texel, steps, point.w, normal)) {
    wall = wall_in(point.xyz, normal, first, second);
  }
#endif
  out_centre = vec4(point.xyz, facing.z);
  out_first = vec4(first, wall.x);
  out_second = vec4(second, wall.y);
  out_value = vec4(flux.rgb, wall.z);
}
