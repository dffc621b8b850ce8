// A lamp's node tree for directions, places on the lamp or distances; what is not asked for stands at its reference.
//
// The point is as Cycles has it: position on the lamp (a sun's is its direction), normal along the direction that light
// leaves by (of an area lamp its axis), incoming towards who is lit. `lamp.rows`: rows of the object's matrix.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "generated/material"

#define LAMP_ROUND 0
#define LAMP_SUN 1
#define LAMP_AREA 2

vec3 octahedral_direction(vec2 place)
{
  vec2 p = 2.0 * place - 1.0;
  vec2 over = abs(p);  // a border's texel is the one that it meets across the edge
  if (over.x > 1.0) {
    p = vec2(sign(p.x) * (2.0 - over.x), -p.y);
  }
  if (over.y > 1.0) {
    p = vec2(-p.x, sign(p.y) * (2.0 - over.y));
  }
  vec3 d = vec3(p, 1.0 - abs(p.x) - abs(p.y));
  if (d.z < 0.0) {
    d.xy = (1.0 - abs(d.yx)) * vec2(d.x >= 0.0 ? 1.0 : -1.0, d.y >= 0.0 ? 1.0 : -1.0);
  }
  return normalize(d);
}

vec3 cone_direction(vec2 place, float edge)
{
  vec2 p = (2.0 * place - 1.0) * edge;  // 2 sin(angle / 2)
  float squared = min(dot(p, p), 4.0);
  return vec3(p * sqrt(max(1.0 - 0.25 * squared, 0.0)), 0.5 * squared - 1.0);
}

void main()
{
  vec2 texel = floor(gl_FragCoord.xy);
  vec2 place = (texel - 0.5) / lamp.options.z;  // within the border
  vec3 local = lamp.direction.xyz;
  vec2 uv = lamp.place.xy;
  float path = lamp.place.z;
  int asked = int(lamp.options.x);
  if (asked == 1) {
    local = octahedral_direction(place);
  }
  else if (asked == 2) {
    local = cone_direction(place, lamp.options.w);
  }
  else if (asked == 3) {
    uv = place;
  }
  else if (asked == 4) {
    path = exp(lamp.direction.w + texel.x * lamp.place.w);
  }
  int kind = int(lamp.options.y);
  vec3 direction = local.x * lamp.axis_x.xyz + local.y * lamp.axis_y.xyz + local.z * lamp.axis_z.xyz;
  SurfacePoint point;
  point.object_row0 = lamp.rows[0];
  point.object_row1 = lamp.rows[1];
  point.object_row2 = lamp.rows[2];
  vec3 centre = vec3(lamp.rows[0].w, lamp.rows[1].w, lamp.rows[2].w);
  point.position = centre + lamp.axis_x.w * direction;  // w: the radius of a ball, else 0
  point.normal = direction;
  point.instancer_uv = vec2(0.0);
  if (kind == LAMP_ROUND) {
    vec3 in_object = object_from_world_normal(point, direction);
    float turn = (in_object.x == 0.0 && in_object.y == 0.0) ? 0.0 : atan(in_object.x, in_object.y);
    point.instancer_uv = vec2(0.5 - turn / (2.0 * PI), 1.0 - acos(clamp(in_object.z, -1.0, 1.0)) / PI);
    if (lamp.axis_y.w > 0.0) {  // of a spot: half the cotangent of its half angle
      vec3 in_spot = object_from_world(point, direction);
      point.instancer_uv = 0.5 + in_spot.xy * (lamp.axis_y.w / max(-in_spot.z, 1e-6));
    }
  }
  else if (kind == LAMP_SUN) {
    point.position = direction - material_scene.origin.xyz;
    point.instancer_uv = 0.5 + 0.5 * lamp.axis_y.w * local.xy / max(-local.z, 1e-6);  // cotangent of the half angle
  }
  else {
    vec2 away = 2.0 * uv - 1.0;
    point.position = centre + away.x * lamp.half_u.xyz + away.y * lamp.half_v.xyz;
    point.normal = -lamp.axis_z.xyz;
    point.instancer_uv = uv;
  }
  point.mesh_normal = point.normal;
  point.geometric_normal = point.normal;
  point.incoming = direction;
  point.backfacing = false;
  point.ray = RAY_LAMP;
  point.refracts = false;
  point.object_color = lamp.color;
  point.object_random = lamp.half_u.w;
  point.object_index = lamp.half_v.w;
  point.object_attributes = 0;
  point.instancer_generated = vec3(path, 0.0, 0.0);  // a lamp has no instancer: the way that its light goes
  point.position_dx = vec3(0.0);
  point.position_dy = vec3(0.0);
  for (int i = 0; i < 8; i++) {
    point.attributes[i] = vec4(0.0);
    point.attributes_dx[i] = vec4(0.0);
    point.attributes_dy[i] = vec4(0.0);
  }
  fill_attributes(point);
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  out_radiance = vec4(c.emission, 1.0);
}
