// The mean of what walks bring over places of the object around, per channel within half a free path and a fraction of the
// pixels' window: light from beyond the window changes over no less; of many samples less is asked, by the fourth root of
// their number, so that what it blurs goes with them (lighting/walked_light.py).
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "subsurface/image.glsl"
#include "subsurface/profile.glsl"
#include "subsurface/walked.glsl"

#define TAPS 24
#define GOLDEN 2.39996323
#define PATHS 0.5     // free paths, and
#define PIXELS 1.2    // or widths of a pixel
#define WINDOWS 0.4   // windows of pixels: standard deviation of the mean's weights

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 near = walked_near_fetch(pixel);
  out_direct = walked_direct_fetch(pixel);
  out_indirect = walked_indirect_fetch(pixel);
  out_near = near;
  if (near.w <= 0.0) {
    return;
  }
  vec4 share = scatter_share_fetch(pixel);
  float object = floor(share.w * 0.25);
  vec3 position = surface_position_fetch(pixel).xyz;
  vec4 normals = surface_normal_fetch(pixel);
  vec3 normal = octahedral_decode(normals.xy);
  vec3 face = octahedral_decode(normals.zw);
  float pixel_size = pixel_width_at(position);
  float range = window_of_walks(object_texel(first_object + OBJECT_TEXELS * (int(object) - 1)), pixel_size);
  vec3 wide = max(narrowness * min(PATHS * spread_length_fetch(pixel).xyz, vec3(WINDOWS * range)), vec3(PIXELS * narrowness * pixel_size));
  float widest = max_component(wide);
  vec3 narrower = vec3(0.5) / (wide * wide) - vec3(0.5 / (widest * widest));
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(face, tangent, bitangent);
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 233);
  float turn = to_unit(roll.x) * 2.0 * PI;
  float shift = to_unit(roll.y);
  vec3 direct = out_direct.rgb;
  vec3 indirect = out_indirect.rgb;
  vec3 left = near.rgb;
  vec3 whole = vec3(1.0);
  for (int k = 0; k < TAPS; k++) {
    float r = widest * sqrt(-2.0 * log(1.0 - 0.97 * (float(k) + shift) / float(TAPS)));
    float angle = turn + GOLDEN * float(k);
    ivec2 other;
    if (!pixel_seen(position + r * (cos(angle) * tangent + sin(angle) * bitangent), other) || all(equal(other, pixel))) {
      continue;
    }
    vec4 there = walked_near_fetch(other);
    if (there.w <= 0.0 || floor(scatter_share_fetch(other).w * 0.25) != object) {
      continue;
    }
    vec3 path = surface_position_fetch(other).xyz - position;
    vec3 facing = octahedral_decode(surface_normal_fetch(other).xy);
    float same = smoothstep(0.7, 0.95, dot(facing, normal)) * step(abs(dot(path, face)), widest + pixel_size);
    vec3 weight = same * exp(-dot(path, path) * narrower);
    direct += weight * walked_direct_fetch(other).rgb;
    indirect += weight * walked_indirect_fetch(other).rgb;
    left += weight * there.rgb;
    whole += weight;
  }
  out_direct.rgb = direct / whole;
  out_indirect.rgb = indirect / whole;
  out_near.rgb = left / whole;
}
