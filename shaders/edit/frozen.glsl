// Views that edits keep. Light that enters closed glass goes on as it did from the eye of such a view: `frozen_eyes` holds
// them, and the length of an edit is 2 and the number of its own, from 1, over FROZEN_NUMBERS.
#define FROZEN_NUMBERS 1024.0

// Where the middle of a lobe comes from: mirrored, or bent.
vec3 reflected_or_bent(Surface s, vec3 viewer, bool bent)
{
  float cosine = dot(viewer, s.glossy_normal);
  if (!bent) {
    return safe_normalize(2.0 * cosine * s.glossy_normal - viewer);
  }
  float squared = 1.0 - (1.0 - cosine * cosine) / (s.glossy_ior * s.glossy_ior);
  return safe_normalize((cosine / s.glossy_ior - sqrt(max(squared, 0.0))) * s.glossy_normal - viewer / s.glossy_ior);
}

#ifdef HAS_FROZEN_EYES
// How the middle of the lobe that a viewer sees through a surface turns to that of the frozen view.
vec4 entering_turn(Surface s, vec4 edit, vec3 viewer)
{
  int number = int((length(edit) - 2.0) * FROZEN_NUMBERS + 0.5);
  if (number <= 0 || number >= int(0.5 * FROZEN_NUMBERS) || !edits_what_leaves(s)) {
    return vec4(0.0, 0.0, 0.0, 1.0);
  }
  vec3 eye = frozen_eyes_fetch(ivec2((number - 1) & 2047, (number - 1) >> 11)).xyz;
  vec3 meant = reflected_or_bent(s, safe_normalize(eye - s.position), true);
  return quaternion_between(reflected_or_bent(s, viewer, true), meant);
}

// A direction that a viewer sees through a surface, turned so.
vec3 entering_frozen(Surface s, vec4 edit, vec3 viewer, vec3 direction)
{
  return quaternion_turned(entering_turn(s, edit, viewer), direction);
}
#endif
