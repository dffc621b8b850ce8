// How much of the light that meets a surface leaves it again, glossy reflection included: surfaces out of sight reflect
// all of it evenly, which keeps the energy right where direction is second-order.

vec3 surface_albedo(Surface s, float mu)
{
  vec3 albedo = s.diffuse;
  if (s.kind > LOBE_REFRACTION) {
    albedo += s.glossy_weight;  // sheen, translucent, toon: the weight is their albedo
  }
  else if (s.kind != LOBE_REFRACTION && max_component(s.glossy_weight) > 0.0) {
    vec2 alpha = lobe_alpha(s.glossy_roughness, s.glossy_anisotropy);
    albedo += s.glossy_weight * glossy_albedo(s.kind, s.glossy_tint, s.glossy_edge, s.glossy_ior,
                                              sqrt(sqrt(alpha.x * alpha.y)), mu);
  }
  return max(albedo, vec3(0.0));
}
