// Lamps that a picture shows, in the pixels of its guide: added to what surfaces emit there (addon/surfaces/first_look.py).
// Leaves out media: a picture that has some shows what emits in its own pixels.
// Leaves out links: the camera sees lamps whatever they light.
#include "ask/view.glsl"
#include "light/sources.glsl"
#define SLACK 1.002  // of distances, which the guide holds as half floats

void main()
{
  vec3 origin = view_origin(gl_FragCoord.xy);
  vec3 direction = view_direction(gl_FragCoord.xy);
  float inverse = guide_fetch(ivec2(gl_FragCoord.xy)).w;
  float along = max(-dot(direction, film_view.backward.xyz), 1e-6);
  float limit = inverse > 0.0 ? SLACK / (inverse * along) : 1e30;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < light_count; i++) {
    float hit_distance;
    float density;
    vec3 radiance = light_hit(light_read(i), origin, direction, hit_distance, density);
    sum += hit_distance < limit ? radiance : vec3(0.0);
  }
  out_glow = vec4(min(sum, vec3(60000.0)), dot(sum, vec3(1.0)) > 0.0 ? known : 0.0);
}
