// The largest q that the table of a view can hold: that of its nearest caster. A blocker that is more than MOST_RANGE
// times nearer to the light than the farthest receiver counts as if it stood there: its kernel is smaller than it
// should be, but receivers keep 10 of the table's 15 bits.
#define MOST_RANGE 32.0
#define VSSM_Q 32767.0
#define VSSM_SQUARED 524287.0

float vssm_range(ivec2 texel)
{
  ivec2 cell = texel >> top_level;
  float nearest = depth_bounds_fetch(cell + ivec2(0, bounds_rows - (bounds_rows >> (top_level - 1)))).y;
  vec2 limits = depth_limits_fetch(cell).xy;
  return clamp(nearest, 1e-30, (limits.y > 0.5) ? max(MOST_RANGE * limits.x, 1e-30) : 1.0);
}
