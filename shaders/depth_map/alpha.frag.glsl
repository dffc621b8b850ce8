// Casters with alpha (see opaque.frag.glsl): each layer casts with the probability of its opacity, so that the mean transmits the product.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"
#include "depth_map/layer.glsl"

#ifdef OWN_SURFACE
// The change of q per texel on the plane through a place, and q there: the place is not on its triangle.
vec2 plane_gradient(vec3 place, vec3 normal, vec2 texel, out float here)
{
  vec4 h = vec4(place, 1.0);
  float depth = dot(row_w, h);
  vec2 window = vec2(dot(row_x, h), dot(row_y, h)) / depth;
  here = dot(row_q, h) / depth;
  vec3 to_x = row_x.xyz - window.x * row_w.xyz;
  vec3 to_y = row_y.xyz - window.y * row_w.xyz;
  vec3 to_q = row_q.xyz - here * row_w.xyz;
  // Of a step in the plane that stays in its row of texels, and of one that stays in its column.
  vec3 along_x = cross(to_y, normal);
  vec3 along_y = cross(normal, to_x);
  float area = dot(to_x, along_x);
  float least = 1e-3 * length(to_x) * length(to_y);
  // A plane seen edge-on is as steep as this; both areas are the same number.
  area = (abs(area) < least) ? ((area < 0.0) ? -least : least) : area;
  return vec2(dot(to_q, along_x) * texel.x, dot(to_q, along_y) * texel.y) / area;
}

#endif
void main()
{
  float w = dot(row_w, vec4(world_position, 1.0));
  float q = dot(row_q, vec4(world_position, 1.0)) / w;
  float q_dx = dFdx(q);
  float q_dy = dFdy(q);
#ifdef OWN_SURFACE
  vec2 texel = vec2(dFdx(dot(row_x, vec4(world_position, 1.0)) / w), dFdy(dot(row_y, vec4(world_position, 1.0)) / w));
#endif
  Instance instance = instance_read(instance_flat.x);
  SurfacePoint point = surface_point(safe_normalize(light_point.xyz - light_point.w * world_position), instance);
  point.ray = RAY_SHADOW;
#ifdef OWN_CLOSURES
  OwnHit own;
  if (!own_hit(point, instance, own) || own.bare) {
    discard;
  }
  gl_FragDepth = projected_depth(point.position, PROJECTION);
  q = dot(row_q, vec4(point.position, 1.0)) / dot(row_w, vec4(point.position, 1.0));
#elif defined(OWN_SURFACE)
  if (!own_surface(point, instance)) {
    discard;
  }
  gl_FragDepth = projected_depth(point.position, PROJECTION);
  vec2 gradient = plane_gradient(point.position, point.geometric_normal, texel, q);
  q_dx = gradient.x;
  q_dy = gradient.y;
#endif
#ifndef CASTS_WHOLE
  point.refracts = glass_blocks != 0;  // what it lets through is a lobe then, and no transparency
  uvec3 bits = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(instance_flat.x) * 9781u));
  bits = hash3(uvec3(bits.x, uint(gl_PrimitiveID), uint(caster_sample)));
  Closures c = closures_begin(point.normal, to_unit(bits.y), 0.0);
  evaluate_material(point, c);
  closures_end(c);
  // Of one channel, where light is asked for by channel (addon/lighting/loop.py).
  float passing = (channel_asked > 0) ? c.transparency[channel_asked - 1] : dot(c.transparency, vec3(1.0 / 3.0));
  if (to_unit(bits.x) < passing) {
    discard;
  }
#endif
#ifdef LAYER
  out_depth = vec4(LAYER_CASTER + max(q, 0.0));  // w alone is written
#else
  out_depth = vec4(q, q_dx, q_dy, 2.0);  // above 1: drawn at random
#endif
}
