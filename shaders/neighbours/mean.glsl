// Mean of the light that arrives at 4x4 pixels `stride` apart, of those that lie on the same surface. Where there is
// none (leaves, wires), of all that are near. LOBES: w of the colour is the kind of the diffuse lobe, and light of those of
// other kinds arrives elsewhere: at leaves from behind, at hair from all sides.
#include "lib/gbuffer.glsl"
#include "neighbours/pixel_size.glsl"

// Light without the surface's colour, so that the mean keeps textures. The output's w is the variance of the mean's
// luminance; where the input has it, only pixels join whose difference it explains, so that shade stays where it is.
vec3 arriving_at(ivec2 pixel)
{
  vec3 light = light_in_fetch(pixel).rgb;
#ifdef REFLECTED
  light /= max(surface_diffuse_fetch(pixel).rgb, vec3(1e-6));
#endif
  return light;
}

void run(ivec2 pixel)
{
  ivec2 size = light_in_size();
  vec4 centre = surface_position_fetch(pixel);
  out_arriving = vec4(arriving_at(pixel), 0.0);
  if (centre.w == 0.0) {
    return;  // sums hold samples that met a surface here where the last one met none
  }
#ifdef LOBES
  if (surface_diffuse_fetch(pixel).w < 0.0) {
    return;  // of hair each strand is a surface of its own: the mean of those that differ little would be dark
  }
#endif
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).xy);
  float pixel_size = pixel_size_at(centre.xyz);
  vec4 on_surface = vec4(0.0);
  float squares = 0.0;
#ifdef WITH_VARIANCE
  vec4 own = light_in_fetch(pixel);
#endif
  vec4 nearby = vec4(0.0);
  for (int y = -2; y < 2; y++) {
    for (int x = -2; x < 2; x++) {
      ivec2 other = pixel + ivec2(x, y) * stride;
      if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, size))) {
        continue;
      }
      vec4 position = surface_position_fetch(other);
      bool lit = position.w != 0.0 && max_component(surface_diffuse_fetch(other).rgb) > 0.0;
#ifdef LOBES
      lit = lit && surface_diffuse_fetch(other).w == surface_diffuse_fetch(pixel).w;
#endif
      vec3 path = position.xyz - centre.xyz;
      if (lit) {
        vec4 light = vec4(arriving_at(other), 1.0);
        vec3 facing = octahedral_decode(surface_normal_fetch(other).xy);
        bool same = dot(normal, facing) > 0.8 && abs(dot(normal, path)) < 2.0 * pixel_size * float(stride);
#ifdef WITH_VARIANCE
        float noise = own.w + light_in_fetch(other).w;
        float difference = luminance(light.rgb - own.rgb);
        float equal = 0.01 * luminance(own.rgb);
        same = same && difference * difference <= 16.0 * noise + equal * equal;
#endif
        float bright = luminance(light.rgb);
        on_surface += same ? light : vec4(0.0);
        squares += same ? bright * bright : 0.0;
        nearby += (length(path) < 8.0 * pixel_size * float(stride)) ? light : vec4(0.0);
      }
    }
  }
  bool alone = on_surface.w < 1.5;
  vec3 mean = alone ? nearby.rgb / max(nearby.w, 1.0) : on_surface.rgb / max(on_surface.w, 1.0);
  float bright = luminance(mean);
  float spread = max(squares / max(on_surface.w, 1.0) - bright * bright, 0.0);
  out_arriving = vec4(mean, alone ? bright * bright : spread / max(on_surface.w, 1.0));
}
