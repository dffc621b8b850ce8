// Relief: the surface of a material that displaces, found by a ray in the shell over its mesh.
//
// Risser, Shah & Pattanaik, "Faster Relief Mapping Using the Secant Method", 2007: a linear search for the first interval
// in which the ray crosses the heights, then false position, which brackets the crossing. Here heights are asked of the
// material's own tree, and what is searched are prisms (Hirche et al. 2004), so that outlines are the relief's and frames
// are exact: a place in a prism is found by Newton's method, and attributes vary over its triangle as they always do.
// RAYS_BEGIN: from where rays come, w 0 if from infinitely far.
// A crossing counts from both sides, as a sheet is seen from below, too.
#include "lib/surface_point.glsl"
#include "surface/shell.glsl"

#define SEARCH_FALSE_POSITION 0  // with Illinois' halving, which does not stagnate
#define SEARCH_INTERVAL 1        // plain false position
#define SEARCH_BISECTION 2
#define PIXELS_A_STEP 2.0  // that a step of the linear search covers on the mesh
#define FEWEST_STEPS 8.0  // fewer miss rims that a ray of light grazes, and light leaks past them
#define FLAT_STEPS 3.0    // where all of the relief is a plane
#define OVERLAP 0.02  // pixels
#define NEAR_ENOUGH 0.01  // pixels, and a tenth of it of the range of heights: a crossing that is narrowed down no further

// Height of the relief, m, over a place of the triangle whose first corner `corner` is.
float relief_height(SurfacePoint corner, Shell s, vec2 b)
{
  SurfacePoint at = surface_point_moved(corner, b);
  at.normal = normalize(shell_normal(s, b));
  at.mesh_normal = at.normal;
  return dot(material_displacement(at), at.normal);
}

// As seen from so far off that all of it is one pixel, relief is a plane: its mean height by `share`.
float relief_faded(float height, float middle, float share)
{
  return mix(middle, height, share);
}

// The slope at the crossing itself may differ from what the search has bracketed, which faces the ray.
vec3 turned_to(vec3 normal, vec3 viewer)
{
  float cosine = dot(normal, viewer);
  return (cosine < 1e-3) ? normalize(normal + (1e-3 - cosine) * viewer) : normal;
}

bool own_surface(inout SurfacePoint point, Instance instance)
{
  vec4 levels = shell_texel(0);
  vec4 more = shell_texel(1);
  int base = 2 + shell_triangle * SHELL_STRIDE;
  Shell s = shell_read(instance, base, SHELL_STRIDE);
  vec3 direction = -point.incoming;
  vec3 start = point.position;
  vec3 guess = vec3(1.0 / 3.0, 1.0 / 3.0, 0.5 * (levels.x + levels.y));
  if (point.backfacing) {
    // A side by which the ray leaves: what it finds it finds where it enters, unless it begins in here.
    vec4 eye = RAYS_BEGIN;
    if (eye.w < 0.5) {
      return false;
    }
    vec3 inside = shell_place(s, eye.xyz, shell_place(s, eye.xyz, guess));
    if (shell_outside(inside.xy) > 0.0 || inside.z <= levels.x || inside.z >= levels.y) {
      return false;
    }
    start = eye.xyz;
  }
  float width = pixel_width(point.position);

  // The point at the triangle's first corner, whose neighbours are the two others: surface_point_moved then goes anywhere.
  SurfacePoint corner = point;
  corner.position = s.origin;
  corner.backfacing = false;
  corner.geometric_normal = safe_normalize(cross(s.e1, s.e2));
  corner.position_dx = s.e1;
  corner.position_dy = s.e2;
  shell_attributes(corner, base);

  vec3 at = shell_place(s, start, shell_place(s, start, guess));
  vec3 rate = shell_step(s, at, direction);
  // Prisms overlap by a fraction of a pixel, or what rounds to outside of one and to below the surface in the next would
  // be a hole.
  float shortest = min(min(dot(s.e1, s.e1), dot(s.e2, s.e2)), dot(s.e1 - s.e2, s.e1 - s.e2));
  float rim = clamp(OVERLAP * width / sqrt(max(shortest, 1e-37)), 1e-4, 0.05);
  // Where the ray leaves, if it ran straight in the prism.
  float reach = 1e30;
  reach = (rate.x < 0.0) ? min(reach, (at.x + rim) / -rate.x) : reach;
  reach = (rate.y < 0.0) ? min(reach, (at.y + rim) / -rate.y) : reach;
  reach = (rate.x + rate.y > 0.0) ? min(reach, (1.0 + rim - at.x - at.y) / (rate.x + rate.y)) : reach;
  reach = (rate.z < 0.0) ? min(reach, (at.z - levels.x) / -rate.z) : reach;
  reach = (rate.z > 0.0) ? min(reach, (levels.y - at.z) / rate.z) : reach;
  bool bent = dot(s.n1, s.n1) + dot(s.n2, s.n2) > 1e-8;
  reach = max(reach, 0.0) * (bent ? 1.25 : 1.0001);
  if (!(reach < 1e29)) {
    return false;
  }

  float range = levels.y - levels.x;
  float middle = 0.5 * (levels.x + levels.y);
  float share = clamp(2.0 * (range / width - 0.5), 0.0, 1.0);
  vec3 along = direction - dot(direction, corner.geometric_normal) * corner.geometric_normal;
  float count = clamp(ceil(reach * length(along) / (PIXELS_A_STEP * width)), min(FEWEST_STEPS, levels.z), levels.z);
  count = (share > 0.0) ? count : FLAT_STEPS;
  float step_m = reach / count;
  int search = int(levels.w + 0.5);

  float t0 = 0.0;
  float f0 = at.z - relief_faded(relief_height(corner, s, at.xy), middle, share);
  float tolerance = 2e-3 * range;
  bool found = f0 <= 0.0 && (f0 > -tolerance || at.z > levels.y - 1e-3 * range);
  float side = (f0 > 0.0) ? 1.0 : -1.0;
  float t1 = t0;
  float f1 = f0;
  vec3 at1 = at;
  if (!found) {
    bool crossed = false;
    int most = int(count + 0.5) * ((more.y > 0.5) ? 8 : 1);
    for (int i = 1; i <= most; i++) {
      float forward = step_m;
      if (more.y > 0.5) {
        // No height rises faster than the steepest slope, so that nothing is nearer than this.
        float closing = abs(rate.z) + more.z * length(along);
        forward = max(abs(f0) / max(closing, 1e-30), 0.125 * step_m);
      }
      t1 = min(t0 + forward, reach);
      at1 += (t1 - t0) * rate;
      at1 = bent ? shell_nearer(s, start + t1 * direction, at1) : at1;
      f1 = at1.z - relief_faded(relief_height(corner, s, at1.xy), middle, share);
      crossed = f1 * side <= 0.0;
      if (crossed || t1 >= reach || shell_outside(at1.xy) > rim) {
        break;
      }
      t0 = t1;
      f0 = f1;
    }
    if (!crossed) {
      return false;
    }
    f0 *= side;
    f1 *= side;
    float kept = 0.0;
    float enough = min(NEAR_ENOUGH * width, 0.1 * NEAR_ENOUGH * range);
    for (int k = 0; k < int(more.x + 0.5) && min(f0, -f1) > enough; k++) {
      float gap = f0 - f1;
      float part = (search == SEARCH_BISECTION || gap < 1e-30) ? 0.5 : f0 / gap;
      float t = t0 + (t1 - t0) * part;
      at1 = bent ? shell_place(s, start + t * direction, at1) : at + t * rate;
      float f = side * (at1.z - relief_faded(relief_height(corner, s, at1.xy), middle, share));
      if (f > 0.0) {
        t0 = t;
        f0 = f;
        f1 *= (kept > 0.0 && search == SEARCH_FALSE_POSITION) ? 0.5 : 1.0;
        kept = 1.0;
      }
      else {
        t1 = t;
        f1 = f;
        f0 *= (kept < 0.0 && search == SEARCH_FALSE_POSITION) ? 0.5 : 1.0;
        kept = -1.0;
      }
    }
    float last = f0 - f1;
    t1 = t0 + (t1 - t0) * ((last > 1e-30) ? f0 / last : 0.5);
    at1 = bent ? shell_place(s, start + t1 * direction, at1) : at + t1 * rate;
    if (shell_outside(at1.xy) > rim || at1.z < levels.x - 1e-3 * range) {
      return false;
    }
  }

  vec2 b = at1.xy;
  SurfacePoint met = surface_point_moved(corner, b);
  met.normal = normalize(shell_normal(s, b));
  // A pixel's steps on the triangle, for bumps and for the slope of the relief.
  vec3 beside = cross(vec3(1.0), corner.geometric_normal);
  beside = (dot(beside, beside) > 1e-12) ? beside : cross(vec3(-1.0, 1.0, 1.0), corner.geometric_normal);
  met.position_dx = normalize(beside) * width;
  met.position_dy = cross(corner.geometric_normal, met.position_dx);
  vec3 plane = cross(s.e1, s.e2);
  float area = max(dot(plane, plane), 1e-37);
  vec2 bx = vec2(dot(cross(met.position_dx, s.e2), plane), dot(cross(s.e1, met.position_dx), plane)) / area;
  vec2 by = vec2(dot(cross(met.position_dy, s.e2), plane), dot(cross(s.e1, met.position_dy), plane)) / area;
  for (int i = 0; i < 8; i++) {
    met.attributes_dx[i] = bx.x * corner.attributes_dx[i] + bx.y * corner.attributes_dy[i];
    met.attributes_dy[i] = by.x * corner.attributes_dx[i] + by.y * corner.attributes_dy[i];
  }
  const float filter_width = 0.1;
  float here = relief_height(corner, s, b);
  float beside_x = relief_height(corner, s, b + filter_width * bx);
  float beside_y = relief_height(corner, s, b + filter_width * by);
  vec3 outwards = bumped_normal(met, met.normal, filter_width, here, beside_x, beside_y);
  // What lies there is the prism's own surface, which has edges between triangles where normals run smoothly.
  vec3 a = s.e1 + here * s.n1;
  vec3 c = s.e2 + here * s.n2;
  vec3 tangent_x = filter_width * (bx.x * a + bx.y * c) + (beside_x - here) * met.normal;
  vec3 tangent_y = filter_width * (by.x * a + by.y * c) + (beside_y - here) * met.normal;
  vec3 across = cross(tangent_x, tangent_y);
  vec3 flat_normal = safe_normalize(((dot(across, outwards) < 0.0) ? -side : side) * across / (width * width));
  met.position = start + t1 * direction;
  met.normal = side * outwards;
  met.geometric_normal = turned_to(flat_normal, point.incoming);
  met.mesh_normal = met.normal;
  met.backfacing = side < 0.0;
  point = met;
  return true;
}
