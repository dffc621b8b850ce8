#include "edit/frozen.glsl"

// The rotation for a surface of the edited object, as surface_edited of lib/gbuffer.glsl takes it; 0: none.
vec4 edit_of_surface(Surface s, vec3 viewer)
{
  // Of glass whose both ways are in one picture, what an edit of its own is about: what passes, where there is one of that.
  bool mirrored = surface_goes_both_ways(s) && edits.shape.y < 0.5;
  bool bent = s.kind == LOBE_REFRACTION && !mirrored;
  bool solid = edits.shape.x > 0.5;
  vec3 r = reflected_or_bent(s, viewer, bent);
  vec3 meant = r;
  if (edits.frozen.w > 0.5) {
    meant = reflected_or_bent(s, safe_normalize(edits.frozen.xyz - s.position), bent);
  }
  // What leaves a closed object is turned beyond it, where nothing here knows its direction. Freeze turns what enters it, by
  // the eye whose number is in the length (edit/frozen.glsl).
  vec4 q = edited_rotation(s.position, (bent && solid) ? vec3(0.0) : meant, bent);
  if (dot(q, q) == 0.0) {
    return vec4(0.0);
  }
  q = (edits.frozen.w > 0.5 && !(bent && solid)) ? quaternion_product(q, quaternion_between(r, meant)) : q;
  // A length of 2.5 and more would be that of an edit of what glass mirrors: later eyes have no number.
  bool keeps = bent && solid && edits.frozen.w > 0.5 && edits.shape.z < 0.5 * FROZEN_NUMBERS;
  float number = keeps ? edits.shape.z / FROZEN_NUMBERS : 0.0;
  return normalize(q) * ((solid ? 2.0 : 1.0) + (mirrored ? 2.0 : 0.0) + number);
}
