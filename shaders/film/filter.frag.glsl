// One point of the film, which lies at the same place of every pixel, added to all pixels whose filter covers it
// (techniques/film_filter.py). `film_pixel`: which pixel, counted from the own one, it lies in.
#define TAPS (2 * PIXELS + 1)

// Weights of the points around along one axis. At the picture's rim, where pixels around are missing, of the own alone.
void weigh(int at, int size, int own, vec4 first, float last, out float weights[TAPS])
{
  bool inside = at >= 2 * PIXELS && at < size - 2 * PIXELS;
  for (int i = 0; i < TAPS; i++) {
    float tap = (i < 4) ? first[i] : last;
    weights[i] = inside ? tap : ((i - PIXELS == own) ? 1.0 : 0.0);
  }
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 size = seen_0_size();
  BEGIN_ALL
#if PIXELS == 0
  float weight = 1.0;
  ivec2 place = pixel;
  GATHER_ALL
#else
  float across[TAPS];
  float up[TAPS];
  weigh(pixel.x, size.x, film_pixel.x, weights_x, last_weights.x, across);
  weigh(pixel.y, size.y, film_pixel.y, weights_y, last_weights.y, up);
  for (int y = 0; y < TAPS; y++) {
    for (int x = 0; x < TAPS; x++) {
      float weight = across[x] * up[y];
      ivec2 place = clamp(pixel + ivec2(x, y) - PIXELS - film_pixel, ivec2(0), size - 1);
      GATHER_ALL
    }
  }
#endif
  END_ALL
}
