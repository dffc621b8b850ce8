// Reflectance under a film so thin that the waves that its two faces reflect interfere (Belcour & Barla, "A practical
// extension to microfacet theory for the modeling of varying iridescence", 2017), with the choices that Cycles makes: a sum
// over the first three differences of paths, of which colours see what `energy_table` holds (materials/thin_film.py).

#include "lib/closure.glsl"
#include "lib/energy.glsl"
#include "lib/math.glsl"

#define FILM_LEAST 0.1       // nm; thinner ones are left out
#define FILM_PATHS 512       // rows of the table,
#define FILM_COLUMN 192      // the first column,
#define FILM_FARTHEST 60000.0  // and 2 pi times the last difference of paths, nm
#define FILM_FACETS 5        // of a rough surface that are looked at

struct Film {
  float thickness;  // nm
  float ior;
  bool conducts;    // what lies below
  vec3 n;           // its index of refraction, of a dielectric the same thrice; both relative to what lies above
  vec3 k;           // and its extinction
  vec3 edge;        // of a metal drawn by two colours: its reflectance at 82 degrees; below 0: by its index
  vec3 f0;          // of a dielectric, tinted: at normal incidence
};

// Two numbers per channel: a complex number.
struct FilmWave {
  vec3 re;
  vec3 im;
};

FilmWave film_sensitivity(float path)
{
  float place = clamp(path * (2.0 * PI / FILM_FARTHEST), 0.0, 1.0) * float(FILM_PATHS - 1);
  int row = min(int(place), FILM_PATHS - 2);
  float share = place - float(row);
  ivec2 low = ivec2(FILM_COLUMN + 2 * (row % 32), row / 32);
  ivec2 high = ivec2(FILM_COLUMN + 2 * ((row + 1) % 32), (row + 1) / 32);
  FilmWave seen;
  seen.re = mix(energy_table_fetch(low).xyz, energy_table_fetch(high).xyz, share);
  seen.im = mix(energy_table_fetch(low + ivec2(1, 0)).xyz, energy_table_fetch(high + ivec2(1, 0)).xyz, share);
  return seen;
}

FilmWave film_times(FilmWave a, FilmWave b)
{
  FilmWave product;
  product.re = a.re * b.re - a.im * b.im;
  product.im = a.re * b.im + a.im * b.re;
  return product;
}

// Metal by two colours, without its index: the F82 curve through reflectances at 0 and 82 degrees.
vec3 film_f82(float c, vec3 f0, vec3 f82)
{
  float grazing = clamp(1.0 - c, 0.0, 1.0);
  float power5 = grazing * grazing * grazing * grazing * grazing;
  vec3 pull = 17.651384 * (mix(f0, vec3(1.0), 0.46266436) - f82);
  return clamp(mix(f0, vec3(1.0), power5) - pull * (c * power5 * grazing), vec3(0.0), vec3(1.0));
}

// Reflectance of the film's lower face for both polarisations, and by how much it turns their phases.
void film_below(Film film, float ior, float c, out vec3 s, out vec3 p, out FilmWave turn_s, out FilmWave turn_p)
{
  vec3 n2 = film.n * film.n;
  vec3 k2 = film.k * film.k;
  float a2 = ior * ior;
  vec3 t1 = n2 - k2 - vec3(a2 * (1.0 - c * c));
  vec3 t2 = sqrt(t1 * t1 + 4.0 * n2 * k2);
  vec3 u2 = max(0.5 * (t2 + t1), vec3(0.0));
  vec3 v2 = max(0.5 * (t2 - t1), vec3(0.0));
  vec3 u = sqrt(u2);
  vec3 v = sqrt(v2);
  vec3 along = vec3(ior * c);
  s = ((along - u) * (along - u) + v2) / max((along + u) * (along + u) + v2, vec3(1e-20));
  vec3 t3 = (n2 - k2) * c;
  vec3 t4 = 2.0 * film.n * film.k * c;
  p = ((t3 - ior * u) * (t3 - ior * u) + (t4 - ior * v) * (t4 - ior * v))
      / max((t3 + ior * u) * (t3 + ior * u) + (t4 + ior * v) * (t4 + ior * v), vec3(1e-20));
  turn_s.re = along * along - u2 - v2;
  turn_s.im = -2.0 * along * v;
  turn_p.re = (n2 + k2) * (n2 + k2) * (c * c) - a2 * (u2 + v2);
  turn_p.im = 2.0 * along * (2.0 * film.n * film.k * u - (n2 - k2) * v);
  vec3 size_s = sqrt(turn_s.re * turn_s.re + turn_s.im * turn_s.im);
  vec3 size_p = sqrt(turn_p.re * turn_p.re + turn_p.im * turn_p.im);
  turn_s.re = mix(vec3(1.0), turn_s.re / max(size_s, vec3(1e-20)), vec3(greaterThan(size_s, vec3(1e-20))));
  turn_p.re = mix(vec3(1.0), turn_p.re / max(size_p, vec3(1e-20)), vec3(greaterThan(size_p, vec3(1e-20))));
  turn_s.im /= max(size_s, vec3(1e-20));
  turn_p.im /= max(size_p, vec3(1e-20));
  if (film.edge.x >= 0.0) {
    vec3 n = film.n / ior;
    vec3 kk = k2 / a2;
    vec3 f0 = ((n - 1.0) * (n - 1.0) + kk) / ((n + 1.0) * (n + 1.0) + kk);
    s = film_f82(c, f0, film.edge);
    p = s;
  }
}

// One polarisation: what the upper face reflects, and what goes to and fro below it.
vec3 film_sum(float above, vec3 below, FilmWave turn, float path)
{
  float enters = 1.0 - above;
  vec3 both = min(above * below, vec3(0.999999));
  vec3 root = sqrt(both);
  vec3 again = enters * enters * below / (1.0 - both);
  vec3 reflected = again + above;
  vec3 amount = again - enters;
  FilmWave turned = turn;
  for (int m = 1; m < 4; m++) {
    amount *= root;
    FilmWave seen = film_sensitivity(float(m) * path);
    reflected += amount * 2.0 * (turned.re * seen.re + turned.im * seen.im);
    turned = film_times(turned, turn);
  }
  return reflected;
}

// Reflectance at a cosine from the normal.
vec3 film_reflectance(Film film, float cosine)
{
  float mu = clamp(abs(cosine), 0.0, 1.0);
  float ior = mix(1.0, film.ior, smoothstep(0.0, 1.0, film.thickness));  // of less than an atom's layer there is no film
  float squared = 1.0 - (1.0 - mu * mu) / (ior * ior);
  if (squared <= 0.0) {
    return vec3(1.0);
  }
  float c = sqrt(squared);
  float substrate = film.n.x / ior;
  if (!film.conducts && 1.0 - (1.0 - c * c) / (substrate * substrate) <= 0.0) {
    return vec3(1.0);
  }
  float s = (mu - ior * c) / (mu + ior * c);
  float p = (ior * mu - c) / max(ior * mu + c, 1e-20);
  vec3 below_s;
  vec3 below_p;
  FilmWave turn_s;
  FilmWave turn_p;
  film_below(film, ior, c, below_s, below_p, turn_s, turn_p);
  float side_s = (s >= 0.0) ? -1.0 : 1.0;
  float side_p = (p >= 0.0) ? -1.0 : 1.0;
  turn_s.re *= side_s;
  turn_s.im *= side_s;
  turn_p.re *= side_p;
  turn_p.im *= side_p;
  float path = 2.0 * ior * film.thickness * c;
  vec3 found = 0.5 * (film_sum(s * s, below_s, turn_s, path) + film_sum(p * p, below_p, turn_p, path));
  if (!film.conducts) {
    float real = dielectric_f0(film.n.x);
    if (real > 1e-5) {
      vec3 share = clamp((found - 1.0) / (real - 1.0), vec3(0.0), vec3(1.0));
      found *= mix(vec3(1.0), film.f0 / real, share);
    }
  }
  return clamp(found, vec3(0.0), vec3(1.0));
}

// The mean over microfacets that are seen at `mu`: every one of a rough surface is tilted otherwise.
vec3 film_seen(Film film, float mu, float roughness)
{
  float alpha = roughness * roughness;
  if (alpha < 1e-3) {
    return film_reflectance(film, mu);
  }
  vec3 view = vec3(sqrt(max(1.0 - mu * mu, 0.0)), 0.0, mu);
  vec3 stretched = normalize(vec3(alpha * view.x, 0.0, max(view.z, 1e-4)));
  vec3 sum = vec3(0.0);
  for (int i = 0; i < FILM_FACETS; i++) {
    float phi = 2.0 * PI * (float(i) + 0.5) * 0.618034;  // visible normals (Dupuy & Benyoub 2023) at points of a spiral
    float z = (1.0 - (float(i) + 0.5) / float(FILM_FACETS)) * (1.0 + stretched.z) - stretched.z;
    float r = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 cap = vec3(r * cos(phi), r * sin(phi), z) + stretched;
    vec3 facet = safe_normalize(vec3(alpha * cap.xy, max(cap.z, 1e-7)));
    sum += film_reflectance(film, dot(facet, view));
  }
  return sum / float(FILM_FACETS);
}

Film film_over(float thickness, float film_ior, bool conducts, vec3 n, vec3 k)
{
  Film film;
  film.thickness = thickness;
  film.ior = max(film_ior, 1e-5);
  film.conducts = conducts;
  film.n = n;
  film.k = k;
  film.edge = vec3(-1.0);
  film.f0 = vec3(0.0);
  return film;
}

Film film_on_dielectric(float thickness, float film_ior, float ior, vec3 f0)
{
  Film film = film_over(thickness, film_ior, false, vec3(ior), vec3(0.0));
  film.f0 = f0;
  return film;
}

// On a metal of two colours: its index after Gulbrandsen, "Artist friendly metallic Fresnel", 2014.
Film film_on_metal(float thickness, float film_ior, vec3 f0, vec3 edge)
{
  vec3 f82 = fresnel_reflectance(FRESNEL_F82, f0, edge, 1.5, 1.0 / 7.0);
  vec3 r = min(f0, vec3(0.999));
  vec3 root = sqrt(r);
  vec3 n = mix((1.0 + root) / (1.0 - root), (1.0 - r) / (1.0 + r), f82);
  vec3 k = sqrt(max((r * (n + 1.0) * (n + 1.0) - (n - 1.0) * (n - 1.0)) / (1.0 - r), vec3(0.0)));
  Film film = film_over(thickness, film_ior, true, n, k);
  film.edge = f82;
  return film;
}
