// Whether a surface has a lobe that no rays follow, beside its diffuse part: without microfacets, or rougher than those that
// are shaded (`limit`).
bool has_wide_lobe(Surface s, float limit)
{
  bool followed = s.kind == LOBE_REFRACTION || (s.kind < LOBE_REFRACTION && s.glossy_roughness <= limit);
  return !followed && max_component(s.glossy_weight) > 0.0;
}
