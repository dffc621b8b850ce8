// Map Range: one function per interpolation, for numbers and for vectors channel by channel. A range without extent
// gives 0 for a number, and the start of the new range for a vector.

#include "material/math.glsl"

float range_share(float value, float from_low, float from_high)
{
  return safe_divide(value - from_low, from_high - from_low);
}

float range_stepped(float share, float steps)
{
  return (steps > 0.0) ? floor(share * (steps + 1.0)) / steps : 0.0;
}

float range_smooth(float share)
{
  float t = clamp(share, 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

float range_smoother(float share)
{
  float t = clamp(share, 0.0, 1.0);
  return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
}

float range_result(float share, float from_low, float from_high, float low, float high, bool bounded)
{
  float mapped = (from_low != from_high) ? low + share * (high - low) : 0.0;
  return bounded ? clamp(mapped, min(low, high), max(low, high)) : mapped;
}

void map_range_linear(float value, float from_low, float from_high, float low, float high, float steps, bool bounded,
                      out float result)
{
  result = range_result(range_share(value, from_low, from_high), from_low, from_high, low, high, bounded);
}

void map_range_stepped(float value, float from_low, float from_high, float low, float high, float steps, bool bounded,
                       out float result)
{
  float share = range_stepped(range_share(value, from_low, from_high), steps);
  result = range_result(share, from_low, from_high, low, high, bounded);
}

void map_range_smoothstep(float value, float from_low, float from_high, float low, float high, float steps,
                          bool bounded, out float result)
{
  result = range_result(range_smooth(range_share(value, from_low, from_high)), from_low, from_high, low, high, false);
}

void map_range_smootherstep(float value, float from_low, float from_high, float low, float high, float steps,
                            bool bounded, out float result)
{
  result = range_result(range_smoother(range_share(value, from_low, from_high)), from_low, from_high, low, high, false);
}

vec3 range_shares(vec3 value, vec3 from_low, vec3 from_high)
{
  return vec3(range_share(value.x, from_low.x, from_high.x), range_share(value.y, from_low.y, from_high.y),
              range_share(value.z, from_low.z, from_high.z));
}

vec3 range_results(vec3 share, vec3 low, vec3 high, bool bounded)
{
  vec3 mapped = low + share * (high - low);
  return bounded ? clamp(mapped, min(low, high), max(low, high)) : mapped;
}

void map_range_vector_linear(vec3 value, vec3 from_low, vec3 from_high, vec3 low, vec3 high, vec3 steps, bool bounded,
                             out vec3 result)
{
  result = range_results(range_shares(value, from_low, from_high), low, high, bounded);
}

void map_range_vector_stepped(vec3 value, vec3 from_low, vec3 from_high, vec3 low, vec3 high, vec3 steps, bool bounded,
                              out vec3 result)
{
  vec3 share = range_shares(value, from_low, from_high);
  share = vec3(range_stepped(share.x, steps.x), range_stepped(share.y, steps.y), range_stepped(share.z, steps.z));
  result = range_results(share, low, high, bounded);
}

void map_range_vector_smoothstep(vec3 value, vec3 from_low, vec3 from_high, vec3 low, vec3 high, vec3 steps,
                                 bool bounded, out vec3 result)
{
  vec3 share = range_shares(value, from_low, from_high);
  result = range_results(vec3(range_smooth(share.x), range_smooth(share.y), range_smooth(share.z)), low, high, false);
}

void map_range_vector_smootherstep(vec3 value, vec3 from_low, vec3 from_high, vec3 low, vec3 high, vec3 steps,
                                   bool bounded, out vec3 result)
{
  vec3 share = range_shares(value, from_low, from_high);
  result = range_results(vec3(range_smoother(share.x), range_smoother(share.y), range_smoother(share.z)), low, high,
                         false);
}
