// What a surface reflects at a point of the film between the pixels' own: light of the pixels around it that lie on the
// same surface, of all of them where none does; and its colour. `known` are the surfaces that light was found for.
#include "lib/gbuffer.glsl"
#include "neighbours/pixel_size.glsl"

#define REACH 4  // pixels to look at, on each side: from 1 on, until one has light (wires)

void main()
{
  out_diffuse = vec4(0.0);
  out_color = vec4(0.0);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 size = textureSize(arriving, 0);
  vec4 place = texelFetch(surface_position, pixel, 0);
  vec3 albedo = max(texelFetch(surface_diffuse, pixel, 0).rgb, vec3(0.0));
  if (place.w == 0.0 || max_component(albedo) <= 0.0) {
    return;
  }
  out_color.rgb = share * albedo;
  vec3 normal = octahedral_decode(texelFetch(surface_normal, pixel, 0).xy);
  float pixel_size = pixel_size_at(place.xyz);
  vec4 same = vec4(0.0);
  vec4 nearby = vec4(0.0);
  for (int reach = 1; reach <= REACH && nearby.w == 0.0; reach++) {
    for (int y = -reach; y <= reach; y++) {
      for (int x = -reach; x <= reach; x++) {
        ivec2 other = pixel + ivec2(x, y);
        if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, size))) {
          continue;
        }
        vec4 position = texelFetch(known_position, other, 0);
        if (position.w == 0.0 || max_component(texelFetch(known_diffuse, other, 0).rgb) <= 0.0) {
          continue;
        }
        // A tent about the point, which lies `right.w`, `up.w` pixels off the pixel's middle.
        vec2 off = abs(vec2(float(x), float(y)) - vec2(film_view.right.w, film_view.up.w));
        float weight = max(1.5 - off.x, 0.01) * max(1.5 - off.y, 0.01);
        vec4 light = weight * vec4(texelFetch(arriving, other, 0).rgb, 1.0);
        vec3 facing = octahedral_decode(texelFetch(known_normal, other, 0).xy);
        bool equal = dot(normal, facing) > 0.8 && abs(dot(normal, position.xyz - place.xyz)) < 2.0 * pixel_size;
        same += equal ? light : vec4(0.0);
        nearby += light;
      }
    }
  }
  vec4 found = (same.w > 0.0) ? same : nearby;
  out_diffuse = vec4(share * albedo * found.rgb / max(found.w, 1e-6), 0.0);
}
