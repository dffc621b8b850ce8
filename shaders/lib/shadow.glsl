// Visibility of a light sample from its depth maps.
//
// A texel stores the plane of the nearest caster: depth measure q (affine in window coordinates, larger = nearer to
// the light) with its gradient. The receiver is compared twice: with the caster's plane continued to the receiver, and
// with the receiver's plane continued to the texel's centre. Only if both say "behind" there is shadow. A surface
// therefore never shadows itself, flat or convex, and no bias in metres is needed.
//
// The uniform block `sources` (addon/sources/lights.py) lists in `view[]`, per view, rows x, y, w, q and the rectangle
// (origin, size) in the atlas `depth_maps`.

// Where a layer (grass) is nearest to the light, w is LAYER_CASTER and its depth measure, and the rest is that of the caster
// behind it, 0 if there is none. It shadows what lies beside it; its own surface, which shows its own shadows, passes it over.

#define VIEW_TEXELS 5
#include "depth_map/layer.glsl"
#ifndef LAYERS_SHADE  // see grass/light.glsl
#define LAYERS_SHADE(pixel) false
#endif

// A receiver as the first view that contains it sees it.
struct ShadowReceiver {
  int view;
  vec4 rectangle;  // of the view in the atlas: origin, size; w: share of the light's extent that the map stands for
  vec2 ndc;
  float w;  // distance along the view's axis; 1 for orthographic views
  vec2 texel;  // from the view's corner
  float q;
  vec2 gradient;  // of q on the receiver's plane, per texel
  float slack;  // difference in q from its plane that is no difference
  bool layers;  // whether layers shadow it
};

// Difference in q that is none, from a plane with this gradient per texel: rasterisers snap vertices to 1/256 texel, 3 %
// of the slope covers it; 1e-5 covers float32 in q itself.
float shadow_slack(float q, vec2 gradient)
{
  return 1e-5 * abs(q) + 0.03 * dot(abs(gradient), vec2(1.0));
}

// How far a caster is nearer to the light than the receiver, apart from what is no difference: by the caster's plane at
// the receiver (x), and at the centre of the caster's cell, `offset` texels away, by the receiver's plane (y). What stands
// far above a receiver seen edge-on is not excused by the receiver's slope, nor a steep caster by its own. Far negative
// where nothing was drawn.
vec2 shadow_behind(ShadowReceiver r, vec4 caster, vec2 offset)
{
  if (caster.w <= 0.0 || (caster.w >= LAYER_CASTER && caster.x == 0.0)) {
    return vec2(-1e30);
  }
  float height = caster.x - r.q;
  float slack = min(r.slack, shadow_slack(r.q, caster.yz));
  return height + vec2(dot(caster.yz, offset) - slack, dot(r.gradient, offset) - r.slack);
}

// The caster in a texel of the atlas, as it counts for a receiver.
vec4 shadow_caster(ShadowReceiver r, ivec2 texel)
{
  vec4 caster = depth_maps_fetch(texel);
  return (r.layers && caster.w > LAYER_CASTER) ? vec4(caster.w - LAYER_CASTER, 0.0, 0.0, 2.0) : caster;
}

bool shadow_find(int first_view, int view_count, vec3 position, vec3 normal, out ShadowReceiver r)
{
  r.layers = false;
  vec4 p = vec4(position, 1.0);
  vec3 t1;
  vec3 t2;
  orthonormal_basis(normal, t1, t2);
  for (int view = first_view; view < first_view + view_count; view++) {
    vec4 row_w = sources.view[view * VIEW_TEXELS + 2];
    float w = dot(row_w, p);
    if (w <= 0.0) {
      continue;
    }
    vec4 row_x = sources.view[view * VIEW_TEXELS];
    vec4 row_y = sources.view[view * VIEW_TEXELS + 1];
    r.w = w;
    r.ndc = vec2(dot(row_x, p), dot(row_y, p)) / w;
    if (max(abs(r.ndc.x), abs(r.ndc.y)) >= 1.0) {
      continue;
    }
    vec4 row_q = sources.view[view * VIEW_TEXELS + 3];
    r.view = view;
    r.rectangle = sources.view[view * VIEW_TEXELS + 4];
    r.q = dot(row_q, p) / w;
    r.texel = (r.ndc * 0.5 + 0.5) * r.rectangle.z;

    // Gradient of the receiver's plane in texels: two tangents give two equations for it.
    float scale = 0.5 * r.rectangle.z / w;
    vec2 d1 = (vec2(dot(row_x.xyz, t1), dot(row_y.xyz, t1)) - r.ndc * dot(row_w.xyz, t1)) * scale;
    vec2 d2 = (vec2(dot(row_x.xyz, t2), dot(row_y.xyz, t2)) - r.ndc * dot(row_w.xyz, t2)) * scale;
    float q1 = (dot(row_q.xyz, t1) - r.q * dot(row_w.xyz, t1)) / w;
    float q2 = (dot(row_q.xyz, t2) - r.q * dot(row_w.xyz, t2)) / w;
    float determinant = d1.x * d2.y - d1.y * d2.x;
    r.gradient = vec2(0.0);
    if (abs(determinant) > 1e-4 * dot(abs(d1), vec2(1.0)) * dot(abs(d2), vec2(1.0))) {
      r.gradient = vec2(q1 * d2.y - q2 * d1.y, q2 * d1.x - q1 * d2.x) / determinant;
    }
    r.slack = shadow_slack(r.q, r.gradient);
    return true;
  }
  return false;
}

// Distance from `position` along the unit `direction` to where the view's depth measure is q; 1e29 if it never is.
float shadow_distance(int view, vec3 position, vec3 direction, float q)
{
  vec4 row_w = sources.view[view * VIEW_TEXELS + 2];
  vec4 row_q = sources.view[view * VIEW_TEXELS + 3];
  float rise = dot(row_q.xyz, direction) - q * dot(row_w.xyz, direction);
  float t = (q * dot(row_w, vec4(position, 1.0)) - dot(row_q, vec4(position, 1.0))) / ((rise == 0.0) ? 1e-30 : rise);
  return (t > 0.0) ? t : 1e29;
}

// Unit direction in the map in which the receiver's normal points.
vec2 shadow_outward(ShadowReceiver r, vec3 normal)
{
  vec3 row_x = sources.view[r.view * VIEW_TEXELS].xyz;
  vec3 row_y = sources.view[r.view * VIEW_TEXELS + 1].xyz;
  vec3 row_w = sources.view[r.view * VIEW_TEXELS + 2].xyz;
  vec2 outward = vec2(dot(row_x, normal), dot(row_y, normal)) - r.ndc * dot(row_w, normal);
  return outward * inversesqrt(max(dot(outward, outward), 1e-30));
}

// Whether only the caster's own plane says "behind", and it stands at an angle: the caster is either the other side of a
// convex edge, or it overhangs a steep receiver.
bool shadow_unsure(ShadowReceiver r, vec4 caster, vec2 behind)
{
  float turn = length(caster.yz - r.gradient);
  return behind.x > 0.0 && behind.y <= 0.0 && turn > 0.6 * (length(caster.yz) + length(r.gradient));
}

// What then decides, by shadow_behind: one texel down the receiver's slope (out along its normal, where that faces the
// light) the edge is gone, the overhang is not.
vec2 shadow_beside(ShadowReceiver r, vec3 normal)
{
  vec2 down = shadow_outward(r, normal);
  down = (dot(r.gradient, down) > 0.0) ? -down : down;
  vec2 beside = clamp(floor(r.texel + down), vec2(0.0), vec2(r.rectangle.z - 1.0));
  return shadow_behind(r, shadow_caster(r, ivec2(r.rectangle.xy + beside)), r.texel - beside - 0.5);
}

// Whether the caster in a texel of the view (from its corner) stands between light and receiver.
bool shadow_blocked(ShadowReceiver r, vec2 cell, vec3 normal)
{
  vec4 caster = shadow_caster(r, ivec2(r.rectangle.xy + cell));
  vec2 behind = shadow_behind(r, caster, r.texel - cell - 0.5);
  if (shadow_unsure(r, caster, behind)) {
    behind = shadow_beside(r, normal);
  }
  return min(behind.x, behind.y) > 0.0;
}

// The texel that decides for a receiver (from the view's corner): that in which it lies. Where its middle looks past the edge
// of the receiver's surface, on what lies beyond, it knows nothing of what stands before that surface: in the corner of a
// room it would let the light of the sky in. Then the nearest of its neighbours that is not so.
vec2 shadow_cell(ShadowReceiver r)
{
  vec2 most = vec2(r.rectangle.z - 1.0);
  vec2 own = min(floor(r.texel), most);
  vec2 off = r.texel - own - 0.5;
  vec2 side = vec2((off.x > 0.0) ? 1.0 : -1.0, (off.y > 0.0) ? 1.0 : -1.0);
  vec2 nearer = (abs(off.x) > abs(off.y)) ? vec2(side.x, 0.0) : vec2(0.0, side.y);
  for (int k = 0; k < 4; k++) {
    vec2 cell = own + (((k & 1) != 0) ? nearer : vec2(0.0)) + (((k & 2) != 0) ? side - nearer : vec2(0.0));
    cell = clamp(cell, vec2(0.0), most);
    vec4 caster = shadow_caster(r, ivec2(r.rectangle.xy + cell));
    vec2 offset = r.texel - cell - 0.5;
    float height = caster.x - r.q + max(dot(caster.yz, offset), dot(r.gradient, offset));
    if (caster.w > 0.0 && height >= -r.slack) {
      return cell;
    }
  }
  return own;
}

float shadow_visibility(int first_view, int view_count, vec3 position, vec3 normal, bool layers)
{
  ShadowReceiver r;
  if (!shadow_find(first_view, view_count, position, normal, r)) {
    return 1.0;
  }
  r.layers = layers;
  return shadow_blocked(r, shadow_cell(r), normal) ? 0.0 : 1.0;
}
