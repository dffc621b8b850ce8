// The mean of what walks bring over places of the object around, per channel within half a free path and a fraction of the
// pixels' window: light from beyond the window changes over no less; of many walks less is asked, by the fourth root of
// their number, so that what it blurs goes with them (lighting/walked_light.py), and of one sample all, whose outlines are
// hard. Pixels come in pairs, one on either side, so that light which rises or falls evenly stays as it is. Where the other one
// shows something else, at outlines, a pixel counts the less the more walks there are: there light rises inwards.
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "subsurface/image.glsl"
#include "subsurface/profile.glsl"
#include "subsurface/walked.glsl"

#define PAIRS 12
#define ALONE 0.3     // of a pixel's weight where its other one shows something else, of few walks: less noise for some bias
#define GOLDEN 2.39996323
#define PATHS 0.5     // free paths, and
#define PIXELS 0.6     // or widths of a pixel
#define WINDOWS 0.4   // windows of pixels: standard deviation of the mean's weights

// Per channel; 0 where the pixel shows another object or another side of it.
vec3 tap_weight(ivec2 pixel, float object, vec3 position, vec3 normal, vec3 face, float reach, vec3 narrower)
{
  if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, surface_position_size()))
      || !(walked_near_fetch(pixel).w > 0.0) || floor(scatter_share_fetch(pixel).w * 0.25) != object) {
    return vec3(0.0);
  }
  vec3 path = surface_position_fetch(pixel).xyz - position;
  vec3 facing = octahedral_decode(surface_normal_fetch(pixel).xy);
  float same = smoothstep(0.7, 0.95, dot(facing, normal)) * step(abs(dot(path, face)), reach);
  return same * exp(-dot(path, path) * narrower);
}

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
  vec3 free_path = max(spread_length_fetch(pixel).xyz, vec3(LEAST_SCALE));
  float many = float(samples * walks_of_pixel(walks, most_walks, dense_walks, pixel_size, free_path)) / float(FEW_WALKS);
  float narrowness = pow(clamp(many, 1.0, float(samples * samples)), -0.25);
  float alone = ALONE * pow(narrowness, 4.0);
  vec3 wide = max(narrowness * min(PATHS * free_path, vec3(WINDOWS * range)), vec3(PIXELS * narrowness * pixel_size));
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
  for (int k = 0; k < PAIRS; k++) {
    float r = widest * sqrt(-2.0 * log(1.0 - 0.97 * (float(k) + shift) / float(PAIRS)));
    float angle = turn + GOLDEN * float(k);
    ivec2 other;
    if (!pixel_seen(position + r * (cos(angle) * tangent + sin(angle) * bitangent), other) || all(equal(other, pixel))) {
      continue;
    }
    ivec2 across = 2 * pixel - other;
    vec3 weight1 = tap_weight(other, object, position, normal, face, widest + pixel_size, narrower);
    vec3 weight2 = tap_weight(across, object, position, normal, face, widest + pixel_size, narrower);
    vec3 both = min(weight1, weight2);
    weight1 = mix(both, weight1, alone);
    weight2 = mix(both, weight2, alone);
    if (max_component(weight1) > 0.0) {
      direct += weight1 * walked_direct_fetch(other).rgb;
      indirect += weight1 * walked_indirect_fetch(other).rgb;
      left += weight1 * walked_near_fetch(other).rgb;
      whole += weight1;
    }
    if (max_component(weight2) > 0.0) {
      direct += weight2 * walked_direct_fetch(across).rgb;
      indirect += weight2 * walked_indirect_fetch(across).rgb;
      left += weight2 * walked_near_fetch(across).rgb;
      whole += weight2;
    }
  }
  out_direct.rgb = direct / whole;
  out_indirect.rgb = indirect / whole;
  out_near.rgb = left / whole;
}
