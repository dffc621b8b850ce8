// A box about one stroke of the aperture: entry 2 i of the list holds its ends, entry 2 i + 1 radii and opacity.
vec4 stroke_entry(int index)
{
  return strokes_fetch(ivec2(index & 2047, index >> 11));
}

void main()
{
  vec4 both = stroke_entry(2 * gl_InstanceID);
  vec4 drawn = stroke_entry(2 * gl_InstanceID + 1);
  float reach = max(max(drawn.x, drawn.y), 0.5 * texel_mm) + texel_mm;
  vec2 low = min(both.xy, both.zw) - reach;
  vec2 high = max(both.xy, both.zw) + reach;
  ends = both;
  brush = drawn;
  place_mm = mix(low, high, corner);
  gl_Position = vec4(place_mm * (2.0 / window_mm), 0.0, 1.0);
}
