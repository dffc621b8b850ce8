// Adds what one point of the film shows to the pairs (id, weight) of all pixels whose filter covers it. `seen`: z is the
// instance, y the material, w whether there is any. CRYPTO_ID(seen): its id. SLOTS pairs a pixel; LOAD_ALL and STORE_ALL
// move them between the images and `ids`, `weights`.
#include "film/filter_weights.glsl"

vec4 instance_ids(float number)
{
  int k = int(number + 0.5);
  return object_ids_fetch(ivec2(k & 2047, k >> 11));
}

vec4 material_of(float number)
{
  int k = int(number + 0.5);
  return material_ids_fetch(ivec2(k & 2047, k >> 11));
}

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = seen_surface_size();
  if (any(greaterThanEqual(pixel, size))) {
    return;
  }
  float ids[SLOTS];
  float shares[SLOTS];
  vec4 pair;
  LOAD_ALL
#if PIXELS == 0
  {
    float weight = 1.0;
    ivec2 place = pixel;
#else
  bvec2 inside = bvec2(pixel.x >= 2 * PIXELS && pixel.x < size.x - 2 * PIXELS,
                       pixel.y >= 2 * PIXELS && pixel.y < size.y - 2 * PIXELS);
  for (int tap = 0; tap < TAPS * TAPS; tap++) {
    int y = tap / TAPS;
    int x = tap - y * TAPS;
    float weight = weight_of(y, inside.y, film_pixel.y, weights_y, last_weights.y)
                   * weight_of(x, inside.x, film_pixel.x, weights_x, last_weights.x);
    ivec2 place = clamp(pixel + ivec2(x, y) - PIXELS - film_pixel, ivec2(0), size - 1);
#endif
    vec4 seen = seen_surface_fetch(place);
    if (seen.w != 0.0 && weight > 0.0) {
      float id = CRYPTO_ID(seen);
      for (int k = 0; k < SLOTS; k++) {
        if (ids[k] == id || ids[k] == 0.0) {
          ids[k] = id;
          shares[k] += film_share * weight;
          break;
        }
      }
    }
  }
  STORE_ALL
}
