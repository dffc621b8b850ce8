// Radiance of each candidate, in their order in space; w: luminance of the part that was reflected at least once less than
// allowed. With PLACES media lie between candidates and next surfaces. With PAIRS, what a path brings from its next surface is shared in a group, by the balance heuristic.
// Second: the importance of the candidate, and 1 if it has any.
#include "indirect/choice.glsl"
#ifdef PLACES
#include "ask/media.glsl"
#endif

bool all_finite(vec4 v)
{
  return is_finite(v.x) && is_finite(v.y) && is_finite(v.z) && is_finite(v.w);
}

// What comes to candidate `own` from the next surface of candidate `index`.
vec4 later_of(int index, int own)
{
  ivec2 place = candidate_place(index);
  vec4 later = vec4(next_radiance_fetch(place).xyz, candidate_albedo_fetch(place).w);
#ifdef PLACES
  vec3 origin = candidate_point_fetch(candidate_place(own)).xyz;
  vec3 path = next_point_fetch(place).xyz - origin;
  float reach = length(path);
  float sent = luminance(abs(later.xyz));
  if (sent > 0.0) {
    later.xyz *= media_transmittance(origin, path / max(reach, 1e-30), reach, uint(index * candidate_count + own));
    later.w *= luminance(abs(later.xyz)) / sent;
  }
#endif
  return all_finite(later) ? later : vec4(0.0);
}

void main()
{
  out_radiance = vec4(0.0);
  out_importance = vec2(0.0);
  ivec2 place = ivec2(gl_FragCoord.xy);
  int own = int(sorted_order_fetch(place).x);
  if (own >= candidate_count || candidate_point_fetch(candidate_place(own)).w == 0.0) {
    return;
  }
  vec4 later = later_of(own, own);
#ifdef PAIRS
  int index = place.y * LIST_COLUMNS + place.x;
  int first = index / GROUP * GROUP;
  later = vec4(0.0);
  for (int k = 0; k < GROUP; k++) {
    ivec2 member = ivec2((first + k) % LIST_COLUMNS, (first + k) / LIST_COLUMNS);
    float density = pairs_fetch(ivec2(k, index)).x;
    if (density > 0.0) {
      later += later_of(int(sorted_order_fetch(member).x), own) * (density / pair_sums_fetch(member).x);
    }
  }
#endif
  vec4 straight = candidate_radiance_fetch(candidate_place(own));
  vec3 reflected = candidate_albedo_fetch(candidate_place(own)).xyz * later.xyz;
  // Of light of any colour on a surface of any: luminances of factors do not multiply.
  float part = later.w / max(luminance(abs(later.xyz)), 1e-30);
  vec4 radiance = vec4(straight.xyz + reflected, straight.w + part * luminance(abs(reflected)));
  if (all_finite(radiance)) {
    out_radiance = radiance;
    float importance = luminance(abs(radiance.xyz));
    out_importance = vec2(importance, (importance > 0.0) ? 1.0 : 0.0);
  }
}
