// Weights of one point of the film in the pixels whose filter covers it (film/filter.py). `film_pixel`: which pixel,
// counted from the own one, it lies in.
#define TAPS (2 * PIXELS + 1)

// Weight of the point `tap` pixels from the first one around, along one axis. At the picture's rim, where pixels around
// are missing, only the own point counts.
float weight_of(int tap, bool inside, int own, vec4 first, float last)
{
  float around = (tap < 4) ? first[min(tap, 3)] : last;
  return inside ? around : ((tap - PIXELS == own) ? 1.0 : 0.0);
}
