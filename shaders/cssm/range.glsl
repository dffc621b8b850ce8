// Depths of a view: q of its nearest caster and of its farthest receiver (addon/techniques/cssm.py).
vec2 cssm_range(ivec2 texel, out bool perspective)
{
  ivec2 cell = texel >> top_level;
  float nearest = depth_bounds_fetch(cell + ivec2(0, bounds_rows - (bounds_rows >> (top_level - 1)))).y;
  vec2 limits = depth_limits_fetch(cell).xy;
  perspective = limits.y > 0.5;
  return vec2(max(nearest, limits.x * 1.001 + 1e-30), limits.x);
}
