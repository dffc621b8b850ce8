// Whether a ray goes on from the lobe that a surface has kept: of what bends light, of what is smooth enough, and of glass
// that is seen from within, whatever its roughness: most of the light in a solid of frosted glass has been mirrored by its
// faces, and virtual lights, which other rough lobes see, know only what stands outside.
bool mirrors_within(Surface s)
{
  return s.kind == FRESNEL_DIELECTRIC && s.glossy_ior < 1.0;
}

bool lobe_goes_on(Surface s)
{
  return s.kind == LOBE_REFRACTION || s.glossy_roughness <= shaded_roughness || mirrors_within(s);
}
