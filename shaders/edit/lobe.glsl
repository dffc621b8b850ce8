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
  // What leaves a closed object is turned beyond it, where nothing here knows its direction.
  vec4 q = edited_rotation(s.position, (bent && solid) ? vec3(0.0) : meant, bent);
  if (dot(q, q) == 0.0) {
    return vec4(0.0);
  }
  q = (edits.frozen.w > 0.5 && !(bent && solid)) ? quaternion_product(q, quaternion_between(r, meant)) : q;
  return normalize(q) * ((solid ? 2.0 : 1.0) + (mirrored ? 2.0 : 0.0));
}
