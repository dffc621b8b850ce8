// The mean of what a texel covers of the finer level: two texels a side, or, where the finer side is odd, between two and
// three, those at the ends in part. Included where `finer_texel` is defined.
vec4 box_mean(ivec2 texel, ivec2 finer_size)
{
  vec2 ratio = vec2(finer_size) / vec2(finer_size >> 1);
  vec2 low = vec2(texel) * ratio;
  vec2 high = low + ratio;
  ivec2 first = ivec2(floor(low + vec2(1e-3)));
  vec4 sum = vec4(0.0);
  float total = 0.0;
  for (int j = 0; j < 4; j++) {
    float y = float(first.y + j);
    float weight_y = min(high.y, y + 1.0) - max(low.y, y);
    for (int i = 0; i < 4; i++) {
      float x = float(first.x + i);
      float weight = weight_y * (min(high.x, x + 1.0) - max(low.x, x));
      if (weight_y > 1e-3 && weight > 1e-3) {
        sum += weight * finer_texel(min(first + ivec2(i, j), finer_size - ivec2(1)));
        total += weight;
      }
    }
  }
  return sum / total;
}
