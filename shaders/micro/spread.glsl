// Length of the mean of the directions that gloss sends light from one direction to: a lobe of von Mises and Fisher about the
// mirrored one. Facets of roughness alpha deviate from the normal like one of sharpness 2 / alpha^2, directions that they mirror
// like one of a quarter of that over the cosine (Wang, Ren, Gong, Snyder & Guo 2009, "All-frequency rendering of dynamic,
// spatially-varying reflectance"). `cosine` between the direction and the normal.
float length_of_mirrored(float roughness, float cosine)
{
  float alpha = roughness * roughness;
  float sharpness = 0.5 / max(alpha * alpha * max(cosine, 0.05), 1e-6);
  return (1.0 + exp(-2.0 * sharpness)) / (1.0 - exp(-2.0 * sharpness)) - 1.0 / sharpness;
}
