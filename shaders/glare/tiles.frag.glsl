// What scatters of SIDE x SIDE pixels together, and its centre of gravity in pixels.
#include "glare/excess.glsl"

void main()
{
  ivec2 first = SIDE * ivec2(gl_FragCoord.xy);
  ivec2 extent = picture_size();
  vec3 sum = vec3(0.0);
  vec3 weighted = vec3(0.0);
  for (int j = 0; j < SIDE; j++) {
    for (int i = 0; i < SIDE; i++) {
      ivec2 pixel = first + ivec2(i, j);
      if (all(lessThan(pixel, extent))) {
        vec3 light = excess_of(picture_fetch(pixel).rgb, white, most_light);
        float weight = max_component(light);
        sum += light;
        weighted += weight * vec3(vec2(float(i), float(j)) + 0.5, 1.0);
      }
    }
  }
  out_light = vec4(sum, 0.0);
  out_place = vec4(vec2(first) + weighted.xy / max(weighted.z, 1e-30), 0.0, 0.0);
}
