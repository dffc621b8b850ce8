// Visibility of the light's point of this sample: by the depth map, and by a ray where its texels do not agree
// (Lauterbach, Mo, Manocha, "Fast hard and soft shadow generation on complex models using selective ray tracing", 2009).
//
// The four texels around the receiver say together whether it lies at the edge of a shadow or where surfaces meet. The
// nearest of them decides, so that means over jittered maps stay right,
// - where the penumbra is wide: such an edge is one of many that make it, and no texel shows in the picture;
// - where a caster with alpha was drawn at random; rays pass such casters.
// A caster of f < 1/2 texels is seen by one of the four in 2 f of the maps, and keeps 2 f^2 of its shadow in place of f.
// To leave casters of one texel to the map would take a quarter of a texel off those of one to two, and most of the gain.
#define OPAQUE_ONLY
#include "lib/kernel_extent.glsl"
#include "trace/rays.glsl"

#define SHARP_TEXELS 2.0  // half width of a penumbra
#define CLEARANCE 0.25  // most that the ray's start may be off the surface, beside the nearest caster's distance

float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal)
{
  ShadowReceiver r;
  if (!shadow_find(light.first_view, light.view_count, position, normal, r)) {
    return 1.0;
  }
  r.layers = LAYERS_SHADE(pixel);
  vec2 corner = floor(r.texel - 0.5);
  int blocking = 0;
  bool by_lot = false;
  float lowest = 1e30;
  float highest = 0.0;
  for (int k = 0; k < 4; k++) {
    vec2 cell = clamp(corner + vec2(k & 1, k >> 1), vec2(0.0), vec2(r.rectangle.z - 1.0));
    vec4 caster = shadow_caster(r, ivec2(r.rectangle.xy + cell));
    vec2 behind = shadow_behind(r, caster, r.texel - cell - 0.5);
    float above = max(behind.x, behind.y);
    by_lot = by_lot || caster.w > 1.5;
    if (above > 0.0) {
      lowest = min(lowest, above);
      highest = max(highest, max(caster.x + 0.5 * dot(abs(caster.yz), vec2(1.0)), r.q + max(behind.x, 0.0)));
    }
    blocking += int(min(behind.x, behind.y) > 0.0);
  }
  if (lowest >= 1e30) {
    return 1.0;
  }
  if (blocking == 4) {
    return 0.0;
  }
  vec3 direction;
  float density;
  light_sample(light, position, direction, density);
  vec2 penumbra = kernel_extent(light, r, 1.0) * lowest;
  bool by_map = by_lot || min(penumbra.x, penumbra.y) > SHARP_TEXELS || dot(direction, normal) <= 0.0;
  by_map = by_map || ray_offset(position) > CLEARANCE * shadow_distance(r.view, position, direction, r.q + lowest);
  if (by_map) {
    return shadow_blocked(r, min(floor(r.texel), vec2(r.rectangle.z - 1.0)), normal) ? 0.0 : 1.0;
  }
  vec3 origin = ray_origin(position, normal);
  // The ray stays at the receiver's place in the map: what the texels show does not reach higher there.
  float reach = min(1.02 * shadow_distance(r.view, position, direction, highest), 0.9999 * light_distance(light, origin, direction));
  return clear_path(origin, direction, reach, 0u);
}
