// Visibility of the light's point of this sample: by the depth map, and by a ray where its texels do not agree
// (Lauterbach, Mo, Manocha, "Fast hard and soft shadow generation on complex models using selective ray tracing", 2009).
//
// The four texels around the receiver say together whether it lies at the edge of a shadow or where surfaces meet. Under
// a light with extent an edge is one of many that make a penumbra: only where that is narrower than SHARP_TEXELS does a
// texel show in the picture.
//
// Casters with alpha are drawn by lot, texel by texel: where one of the four is such, the nearest decides, and rays pass
// them, so that the mean stays their transparency.
#define OPAQUE_ONLY
#include "lib/kernel_extent.glsl"
#include "trace/hierarchy.glsl"

#define SHARP_TEXELS 2.0  // half width of a penumbra

// Distance from `position` along `direction` to where the view's depth measure is q; 1e29 if it never is.
float edge_distance(int view, vec3 position, vec3 direction, float q)
{
  vec4 row_w = sources.view[view * VIEW_TEXELS + 2];
  vec4 row_q = sources.view[view * VIEW_TEXELS + 3];
  float rise = dot(row_q.xyz, direction) - q * dot(row_w.xyz, direction);
  float t = (q * dot(row_w, vec4(position, 1.0)) - dot(row_q, vec4(position, 1.0))) / ((rise == 0.0) ? 1e-30 : rise);
  return (t > 0.0) ? t : 1e29;
}

float light_visibility(Light light, vec3 position, vec3 normal)
{
  ShadowReceiver r;
  if (!shadow_find(light.first_view, light.view_count, position, normal, r)) {
    return 1.0;
  }
  vec2 last = vec2(r.rectangle.z - 1.0);
  vec2 corner = floor(r.texel - 0.5);
  int blocking = 0;
  bool by_lot = false;
  float lowest = 1e30;
  float highest = 0.0;
  for (int k = 0; k < 4; k++) {
    vec2 cell = clamp(corner + vec2(k & 1, k >> 1), vec2(0.0), last);
    vec4 caster = DEPTH_TEXEL(ivec2(r.rectangle.xy + cell));
    vec2 behind = shadow_behind(caster, r.texel - cell - 0.5, r.q, r.gradient);
    by_lot = by_lot || caster.w > 1.5;
    float above = max(behind.x, behind.y);
    if (above > r.slack) {
      lowest = min(lowest, above);
      highest = max(highest, caster.x + 0.5 * dot(abs(caster.yz), vec2(1.0)));
    }
    blocking += int(min(behind.x, behind.y) > r.slack);
  }
  if (lowest >= 1e30) {
    return 1.0;
  }
  if (blocking == 4) {
    return 0.0;
  }
  vec2 penumbra = kernel_extent(light, r, 1.0) * lowest;
  if (by_lot || min(penumbra.x, penumbra.y) > SHARP_TEXELS) {
    return shadow_blocked(r, min(floor(r.texel), last), normal) ? 0.0 : 1.0;
  }
  vec3 direction;
  float density;
  light_sample(light, position, direction, density);
  vec3 origin = position + normal * max(offset_size, 2e-5 * length(position - film_view.eye.xyz));
  // No caster around the receiver stands higher than the texels say.
  float reach = min(1.02 * edge_distance(r.view, position, direction, highest), 0.9999 * light_distance(light, origin, direction));
  uvec3 salt = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(film_view.sample_index)));
  ivec2 hit;
  return (trace_until(origin, direction, reach, reach, salt.x, hit) >= reach) ? 1.0 : 0.0;
}
