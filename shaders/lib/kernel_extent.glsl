// The part of a depth map that hides a light with extent from a receiver (Fernando, "Percentage-closer soft shadows",
// SIGGRAPH 2005 sketches, written for the depth measure q).
//
// A point at the light's centre plus e and a receiver at the texel p see each other past a blocker that is nearer to
// the light by h (in q) at the texel  p + e' h,  e' = e projected into the map: exact for perspective and orthographic
// maps alike. So all blockers at height h lie in the light's own shape, centred at p and scaled by h: the kernel.
#include "lib/shadow.glsl"
#include "light/sources.glsl"

// Half extents of the kernel, in texels per unit of q, of a share of the light's extent.
vec2 kernel_extent(Light light, ShadowReceiver r, float share)
{
  vec3 row_w = sources.view[r.view * VIEW_TEXELS + 2].xyz;
  vec3 across = sources.view[r.view * VIEW_TEXELS].xyz - r.ndc.x * row_w;
  vec3 along = sources.view[r.view * VIEW_TEXELS + 1].xyz - r.ndc.y * row_w;
  vec2 extent;
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE) || LIGHT_IS(light, LIGHT_SURFACE)) {
    vec3 u = light_u(light);
    vec3 v = light_v(light);
    // A light that reaches towards the receiver as far as half its distance, as faces beside its axis see it, has no
    // kernel in this map: only a part of it that has.
    float towards = length(vec2(dot(row_w, u), dot(row_w, v)));
    share = min(share, 0.25 * r.w / max(towards, 1e-30));
    extent = vec2(length(vec2(dot(across, u), dot(across, v))), length(vec2(dot(along, u), dot(along, v))));
  }
  else {
    float radius = light.radius;
    if (LIGHT_IS(light, LIGHT_SUN)) {
      radius = tan(min(light.radius, 1.5)) / length(sources.view[r.view * VIEW_TEXELS + 3].xyz);
    }
    extent = radius * vec2(length(across), length(along));
  }
  return extent * (0.5 * r.rectangle.z * share);
}
