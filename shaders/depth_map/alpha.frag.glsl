// Casters with alpha (see opaque.frag.glsl): each layer casts with the probability of its opacity, so that the mean transmits the product.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/point.glsl"

void main()
{
  float w = dot(row_w, vec4(world_position, 1.0));
  float q = dot(row_q, vec4(world_position, 1.0)) / w;
  float q_dx = dFdx(q);
  float q_dy = dFdy(q);
  Instance instance = instance_read(instance_flat.x);
  SurfacePoint point = surface_point(safe_normalize(light_point.xyz - light_point.w * world_position), instance);
  point.ray = RAY_SHADOW;
  point.refracts = glass_blocks != 0;  // what it lets through is a lobe then, and no transparency
  uvec3 bits = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(instance_flat.x) * 9781u));
  bits = hash3(uvec3(bits.x, uint(gl_PrimitiveID), uint(sample_index)));
  Closures c = closures_begin(point.normal, to_unit(bits.y), 0.0);
  evaluate_material(point, c);
  closures_end(c);
  if (to_unit(bits.x) < dot(c.transparency, vec3(1.0 / 3.0))) {
    discard;
  }
  out_depth = vec4(q, q_dx, q_dy, 2.0);  // above 1: drawn by lot
}
