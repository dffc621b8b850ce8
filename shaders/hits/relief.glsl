// Relief where a ray has met the mesh below it, at the lowest level of its heights (addon/scene/displacement.py).
//
// The ray is followed from where it came into the layer that heights lie in, down to the mesh. There is no prism: the surface
// goes on as it is at the hit, its attributes as they vary over the triangle there. On a plane with one map that is exact;
// what ends at an edge of the mesh does not end here, and a ray that began within the layer is followed from its top.
#include "lib/surface_point.glsl"

#define HIT_PIXELS_A_STEP 2.0
#define HIT_FEWEST_STEPS 4.0
#define HIT_STEEPEST 16.0  // heights of the layer that a flat ray goes along in it at most

vec4 shell_head(int index)
{
  return shell_corners_fetch(ivec2(index, 0));
}

float hit_height(SurfacePoint point, vec3 outwards, vec2 steps)
{
  SurfacePoint at = surface_point_moved(point, steps);
  at.normal = outwards;
  at.mesh_normal = outwards;
  return dot(material_displacement(at), outwards);
}

void relief_at_hit(inout SurfacePoint point)
{
  vec4 levels = shell_head(0);
  float refinements = shell_head(1).x;
  float range = levels.y - levels.x;
  float width = length(point.position_dx);
  // A footprint of no width cannot tell slopes.
  float widened = max(width, 1e-3 * range) / max(width, 1e-37);
  if (!(width > 1e-20) || !(range > 0.0)) {
    return;
  }
  point.position_dx *= widened;
  point.position_dy *= widened;
  for (int i = 0; i < 8; i++) {
    point.attributes_dx[i] *= widened;
    point.attributes_dy[i] *= widened;
  }
  width *= widened;
  float side = point.backfacing ? -1.0 : 1.0;
  vec3 outwards = side * point.normal;
  vec3 plane = side * point.geometric_normal;
  vec3 direction = -point.incoming;
  float upright = max(dot(outwards, plane), 0.1);
  float rise = dot(direction, plane) / upright;  // of the ray, by metre
  vec3 flat_rate = (direction - rise * outwards) / (width * width);
  vec2 rate = vec2(dot(flat_rate, point.position_dx), dot(flat_rate, point.position_dy));
  float share = clamp(2.0 * (range / width - 0.5), 0.0, 1.0);
  float t = 0.0;
  vec2 steps = vec2(0.0);
  if (side > 0.0 && rise < 0.0 && share > 0.0) {
    float back = min(range / -rise, HIT_STEEPEST * range);
    float along = length(rate) * back;
    float count = clamp(ceil(along / HIT_PIXELS_A_STEP), HIT_FEWEST_STEPS, max(levels.z, HIT_FEWEST_STEPS));
    float forward = back / count;
    float t0 = -back;
    float t1 = t0;
    float f0 = levels.x + rise * t0 - hit_height(point, outwards, t0 * rate);
    float f1 = f0;
    for (int i = 0; i < int(count + 0.5) && f1 > 0.0; i++) {
      t0 = t1;
      f0 = f1;
      t1 = min(t0 + forward, 0.0);
      f1 = levels.x + rise * t1 - hit_height(point, outwards, t1 * rate);
    }
    for (int k = 0; k < int(refinements + 0.5) && f0 > 0.0 && f1 <= 0.0; k++) {
      float middle = t0 + (t1 - t0) * f0 / max(f0 - f1, 1e-30);
      float f = levels.x + rise * middle - hit_height(point, outwards, middle * rate);
      t0 = (f > 0.0) ? middle : t0;
      f0 = (f > 0.0) ? f : f0;
      t1 = (f > 0.0) ? t1 : middle;
      f1 = (f > 0.0) ? f1 : f;
    }
    t = (f0 > 0.0 && f1 <= 0.0) ? t0 + (t1 - t0) * f0 / max(f0 - f1, 1e-30) : t1;
    steps = t * rate;
  }
  const float filter_width = 0.1;
  float here = hit_height(point, outwards, steps);
  vec3 slope_x = filter_width * point.position_dx
                 + share * (hit_height(point, outwards, steps + vec2(filter_width, 0.0)) - here) * outwards;
  vec3 slope_y = filter_width * point.position_dy
                 + share * (hit_height(point, outwards, steps + vec2(0.0, filter_width)) - here) * outwards;
  vec3 place = point.position + t * direction;
  SurfacePoint met = surface_point_moved(point, steps);
  vec3 turned = cross(slope_x, slope_y) / (width * width);
  turned *= (dot(turned, plane) < 0.0) ? -1.0 : 1.0;
  vec3 found = safe_normalize(turned);
  met.position = place;
  met.geometric_normal = found * side;
  // A smooth mesh bends its normal: by as much as it does without relief.
  met.normal = safe_normalize(found + outwards - plane) * side;
  float cosine = dot(met.geometric_normal, point.incoming);
  met.geometric_normal = (cosine < 1e-3) ? safe_normalize(met.geometric_normal + (1e-3 - cosine) * point.incoming)
                                         : met.geometric_normal;
  met.mesh_normal = met.normal;
  point = met;
}
