// What a path is that rays of lobes follow, besides the ray: `path` holds its throughput and, in w, a code.
#define PATH_GLOSSY 1        // the surface that the camera sees mirrors it
#define PATH_TRANSMISSION 2  // or bends it
#define PATH_BENT 4          // added where the last surface did so
#define PATH_CLEAR 8         // added where all surfaces so far were clear glass that let it pass (Film > Transparent Glass)
#define PATH_PHOTONS 8        // the same bit, of glossy paths: the first lobe takes photons (caustics/gloss.glsl), and glass alone is behind it so far
#define PATH_EDITED 16       // added until it leaves a closed object whose edit turns what leaves it
#define PATH_MIRROR 32       // added for each surface so far that mirrored it
#define PATH_THROUGH 0.25     // added as long as glass that goes both ways has let it pass; alone: another way adds the light
                              // of what is met
#define MOST_THROUGH 4       // such surfaces behind the first; as in addon/techniques/shaded_reflections.py
#define FOUND_ELSEWHERE -1.0 // in place of a ray's density: light samples have all that it finds of emission

bool path_is_glossy(int code)
{
  return (code & 3) == PATH_GLOSSY;
}

bool path_is_bent(int code)
{
  return (code & PATH_BENT) != 0;
}

bool path_is_clear(int code)
{
  return (code & PATH_CLEAR) != 0 && !path_is_glossy(code);
}

bool path_has_photons(int code)
{
  return (code & PATH_PHOTONS) != 0 && path_is_glossy(code);
}

bool path_is_edited(int code)
{
  return (code & PATH_EDITED) != 0;
}

// `w`: of the path.
bool path_goes_through(float w)
{
  return w - floor(w) > 0.1;
}

// How many surfaces mirrored it: bounces. Interfaces that bend it are none.
int path_mirrors(int code)
{
  return code / PATH_MIRROR;
}

// Share of a technique of density `density` against another one of density `other` (power heuristic).
float power_share(float density, float other)
{
  float ratio = other / max(density, 1e-30);
  return 1.0 / (1.0 + ratio * ratio);
}
