// One point of the film, which lies at the same place of every pixel, added to all pixels whose filter covers it
// (film/filter.py).
#include "film/filter_weights.glsl"

// Radiance behind media; alpha says how much is covered, and what media take away is.
vec4 film_dimmed(vec4 seen, vec3 passing)
{
  return vec4(seen.rgb * passing, 1.0 - (1.0 - seen.a) * dot(passing, vec3(1.0 / 3.0)));
}

void run(ivec2 pixel)
{
  ivec2 size = seen_0_size();
  BEGIN_ALL
#if PIXELS == 0
  float weight = 1.0;
  ivec2 place = pixel;
  GATHER_ALL
#else
  bvec2 inside = bvec2(pixel.x >= 2 * PIXELS && pixel.x < size.x - 2 * PIXELS,
                       pixel.y >= 2 * PIXELS && pixel.y < size.y - 2 * PIXELS);
  for (int y = 0; y < TAPS; y++) {
    float up = weight_of(y, inside.y, film_pixel.y, weights_y, last_weights.y);
    for (int x = 0; x < TAPS; x++) {
      float weight = up * weight_of(x, inside.x, film_pixel.x, weights_x, last_weights.x);
      ivec2 place = clamp(pixel + ivec2(x, y) - PIXELS - film_pixel, ivec2(0), size - 1);
      GATHER_ALL
    }
  }
#endif
  END_ALL
}
