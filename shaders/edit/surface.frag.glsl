// The rotation of what an edited object mirrors or bends, as a quaternion, where the picture shows it.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "generated/distances"
#include "edit/solve.glsl"

// Where the middle of a lobe comes from.
vec3 reflected_or_bent(Surface s, vec3 viewer, bool bent)
{
  float cosine = dot(viewer, s.glossy_normal);
  if (!bent) {
    return safe_normalize(2.0 * cosine * s.glossy_normal - viewer);
  }
  float squared = 1.0 - (1.0 - cosine * cosine) / (s.glossy_ior * s.glossy_ior);
  return safe_normalize((cosine / s.glossy_ior - sqrt(max(squared, 0.0))) * s.glossy_normal - viewer / s.glossy_ior);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 seen = surface_position_fetch(pixel);
  vec3 to_eye = film_view.eye.xyz - seen.xyz;
  // Interpolated positions of one point differ by some units of the last place between two programs.
  if (seen.w == 0.0 || distance(seen.xyz, world_position) > 1e-5 * (length(to_eye) + length(seen.xyz))
      || max_component(surface_tint_fetch(pixel).rgb) <= 0.0) {
    discard;
  }
  vec3 viewer = view_toward(seen.xyz);
  Surface s = SURFACE_READ(pixel);
  // Of glass whose both ways are in one picture, what an edit of its own is about: what passes, where there is one of that.
  bool mirrored = surface_goes_both_ways(s) && edits.shape.y < 0.5;
  bool bent = s.kind == LOBE_REFRACTION && !mirrored;
  bool solid = edits.shape.x > 0.5;
  vec3 r = reflected_or_bent(s, viewer, bent);
  vec3 meant = r;
  if (edits.frozen.w > 0.5) {
    meant = reflected_or_bent(s, safe_normalize(edits.frozen.xyz - seen.xyz), bent);
  }
  // What leaves a closed object is turned beyond it, where nothing here knows its direction.
  vec4 q = edited_rotation(seen.xyz, (bent && solid) ? vec3(0.0) : meant, bent);
  if (dot(q, q) == 0.0) {
    discard;
  }
  q = (edits.frozen.w > 0.5 && !(bent && solid)) ? quaternion_product(q, quaternion_between(r, meant)) : q;
  out_edit = normalize(q) * ((solid ? 2.0 : 1.0) + (mirrored ? 2.0 : 0.0));  // as surface_edited of lib/gbuffer.glsl takes it
}
