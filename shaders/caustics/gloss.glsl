// Which glossy lobes of the picture take photons that smooth glass has let pass or mirrored: those rougher than mirrors,
// which throw caustics themselves (addon/materials/gloss.py). Smoother ones see the light by rays of their own, which
// find it well; rays of the others leave it out (hits/found.frag.glsl).
#define GLOSS_TAKES_FROM 0.251  // roughness
// Bits of `photons_shine`: on which lobes they do (addon/lighting/caustic_casters.py).
#define PHOTONS_ON_GLOSS 1
#define PHOTONS_ON_SOFT 2

bool gloss_takes_photons(Surface s)
{
  return s.kind <= FRESNEL_F82 && s.glossy_roughness >= GLOSS_TAKES_FROM;
}
