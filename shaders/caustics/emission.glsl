// What a texel of a light's view stands for, and how wide lobes are; `film_view` is the light's view.
// Leaves out links: light that comes by way of surfaces reaches every receiver.
#include "ask/view.glsl"
#include "lib/random.glsl"
#include "ask/media.glsl"

// What media let pass of light along a stretch of a photon's way: with the same random numbers for all photons of a sample,
// which are one smooth map.
vec3 passing_media(vec3 origin, vec3 direction, float limit)
{
  return media_transmittance(origin, direction, min(limit, FARTHEST_MEDIUM), hash3(uvec3(uint(film_view.sample_index), 61u, 0u)).x);
}

// Flux through a texel at a place that it shows, W: what arrives through media across the light's direction times the texel's area there.
vec3 texel_flux(vec3 position, out vec3 direction, out float away, out float area)
{
  bool parallel = view_is_parallel(film_view.eye);
  vec3 way = position - film_view.eye.xyz;
  away = parallel ? dot(way, -film_view.backward.xyz) : length(way);
  direction = parallel ? -film_view.backward.xyz : way / max(away, 1e-30);
  area = (film_view.frame.y - film_view.frame.x) * (film_view.frame.w - film_view.frame.z)
         / (film_view.film.x * film_view.film.y);
  if (!parallel) {
    float ahead = dot(direction, -film_view.backward.xyz);
    area *= ahead * ahead * ahead * away * away;
  }
  vec3 towards;
  float density;
  Light light = light_read(0);
  vec3 arriving = light_sample(light, position, towards, density);
  return arriving * area * passing_media(position, towards, light_distance(light, position, towards));
}

// Half width of a lobe of microfacets as a tangent, about its mirrored or bent direction.
float lobe_width(float alpha, bool bent, float ior)
{
  return alpha * (bent ? abs(1.0 - 1.0 / max(ior, 1e-3)) : 2.0);
}
