// A beam's light at a pixel: flux times scattering times a kernel over the distance between light ray and view ray.
//
// A ray of flux F deposits in a view ray that it passes at an angle gamma the radiance F sigma_s p T T k(u) / sin gamma, u
// the distance of the two lines and k a tent of area 1 (photon beams with a 1-D kernel, Jarosz et al. 2011): nothing in it
// depends on how many rays or pixels there are.
#include "ask/view.glsl"
#include "media/bins.glsl"
#include "media/view_ray.glsl"
#include "media/beam_width.glsl"

#define LEAST_SINE 0.05

void main()
{
  out_volume = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ViewRay ray = view_ray(surface_position_fetch(pixel), gl_FragCoord.xy);
  vec3 way = beam_end.xyz - beam_start.xyz;
  float reach = max(length(way), 1e-20);
  vec3 direction = way / reach;
  vec3 between = beam_start.xyz - ray.origin;
  float cosine = dot(direction, ray.direction);
  float sine_squared = max(1.0 - cosine * cosine, 1e-8);
  float along_beam = (dot(between, ray.direction) * cosine - dot(between, direction)) / sine_squared;
  // The kernel is across both lines: beyond its ends a beam gives nothing, where it would shine through what it starts on.
  if (along_beam < 0.0 || along_beam > reach) {
    discard;
  }
  vec3 position = beam_start.xyz + along_beam * direction;
  float along_view = dot(position - ray.origin, ray.direction);
  if (along_view <= 0.0 || along_view >= ray.limit) {
    discard;
  }
  float off = length(position - ray.origin - along_view * ray.direction);
  float pixel_size = abs(view_pixel());
  pixel_size *= view_is_parallel(film_view.eye) ? 1.0 : (ray.before + along_view) * max(-dot(ray.direction, film_view.backward.xyz), 1e-3);
  float wide = beam_half_width(along_beam, pixel_size);
  float tent = max(1.0 - off / wide, 0.0) / wide;
  if (!(tent > 0.0)) {
    discard;
  }
  uint seed = roll_of(pixel, film_view.sample_index, film_view.seed, 47).x + floatBitsToUint(along_beam);
  // Back along the view: what is around the place, and what is left of its light at the eye.
  media_asked_by(MEDIA_OF_CAMERA);
  media_crossings(position, -ray.direction);
  uint inside = media_at_start();
  vec3 scattered = media_scattered(inside, position, direction, -ray.direction, seed);
  if (!(max_component(scattered) > 0.0)) {
    discard;
  }
  vec3 passing = media_transmittance_known(position, -ray.direction, along_view, seed);
  uint even = uint(beam_start.w - 0.5);  // see within_media in beam_trace.frag.glsl
  passing *= (even != 0u) ? exp(-min(media_depth(even, beam_start.xyz, direction, 0.0, along_beam), vec3(1e30)))
                          : media_transmittance(beam_start.xyz, direction, along_beam, seed + 1u);
  vec3 light = beam_flux.rgb * layers_before(pixel, along_view) * scattered * passing * (tent / max(sqrt(sine_squared), LEAST_SINE));
  out_volume = vec4((is_finite(light.x) && is_finite(light.y) && is_finite(light.z)) ? light : vec3(0.0), 0.0);
}
