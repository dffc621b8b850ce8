// The largest q that the table of a view can hold: that of its nearest caster, up to a limit that leaves the receivers
// enough bits (addon/techniques/vssm.py).
#define VSSM_Q 32767.0
#define VSSM_SQUARED 524287.0

float vssm_range(ivec2 texel)
{
  ivec2 cell = texel >> top_level;
  float nearest = texelFetch(depth_bounds, cell + ivec2(0, bounds_rows - (bounds_rows >> (top_level - 1))), 0).y;
  return clamp(nearest, 1e-30, texelFetch(depth_limits, cell, 0).x);
}
