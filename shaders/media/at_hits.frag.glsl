// What media let pass along rays of lobes, up to what each has met or, where it is nearer, a lamp that it sees.
// Leaves out links: it asks where lamps stand, not whom they light.
#include "media/media.glsl"
#include "hits/path.glsl"
#include "light/sources.glsl"

void main()
{
  out_passed = vec4(1.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec3 start = lobe_start_fetch(pixel).xyz;
  vec3 direction = lobe_way_fetch(pixel).xyz;
  vec4 met = surface_position_fetch(pixel);
  float limit = (met.w != 0.0) ? max(dot(met.xyz - start, direction), 0.0) : FARTHEST_MEDIUM;
  for (int i = 0; i < light_count; i++) {
    float hit_distance;
    float density;
    vec3 radiance = light_hit(light_read(i), start, direction, hit_distance, density);
    limit = (max_component(abs(radiance)) > 0.0) ? min(limit, hit_distance) : limit;
  }
  uint salt = roll_of(pixel, film_view.sample_index, film_view.seed, 161 + ray_number).x;
  int code = int(met_path_fetch(pixel).w + 0.5);  // 0: PATH_THROUGH alone
  media_asked_by((path_is_bent(code) || code == 0) ? MEDIA_OF_TRANSMISSION : MEDIA_OF_GLOSSY);
  out_passed.rgb = media_transmittance_asked(start, direction, limit, salt);
}
