// Whether a ray goes on from the lobe that a surface has kept: of what bends light, of what is smooth enough, and of glass
// that is seen from within, whatever its roughness: most of the light in a solid of frosted glass has been mirrored by its
// faces, and virtual lights, which other rough lobes see, know only what stands outside.
bool mirrors_within(Surface s)
{
  return s.kind == FRESNEL_DIELECTRIC && s.glossy_ior < 1.0;
}

#define FROSTED_FROM 0.1  // roughness; as in hits/surface.frag.glsl

// Frosted glass from within is one lobe of both ways, of which a ray takes one by Fresnel's reflectance of the facet that it
// meets. Were the lobe chosen first, by its albedo, facets of total reflection would weigh as much as the reciprocal of
// that, at each of the many faces on a path's way.
bool frosted_within(Surface s)
{
  return surface_goes_both_ways(s) && s.glossy_ior < 1.0 && s.glossy_roughness > FROSTED_FROM;
}

#ifdef TRANSMISSION
// What bends light, seen by `viewer`; with what it mirrors, where that is one lobe and a ray may take it.
Interface interface_met(Surface s, vec3 viewer, bool mirrors_on)
{
  vec3 mirror = vec3(0.0);
  if (frosted_within(s) && mirrors_on) {
    float mu = clamp(dot(s.glossy_normal, viewer), 0.0, 1.0);
    mirror = surface_mirrored(s).glossy_weight
             * multiscatter_scale(FRESNEL_DIELECTRIC, s.glossy_tint, vec3(1.0), s.glossy_ior, s.glossy_roughness, mu);
  }
  return interface_begin(s.glossy_normal, viewer, s.glossy_roughness, s.glossy_ior, s.glossy_tint, s.glossy_edge.x > 0.5,
                         s.glossy_weight, mirror);
}
#endif

bool lobe_goes_on(Surface s)
{
  return s.kind == LOBE_REFRACTION || s.glossy_roughness <= shaded_roughness || mirrors_within(s);
}
