#define LEAST_COSINE 1e-2  // of light that arrives as photons, over which its irradiance is known
