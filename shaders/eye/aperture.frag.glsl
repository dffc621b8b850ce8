// The pupil between the lids: 1 where it is open (addon/eye/point_spread.py). Millimetres, edges one texel soft.
void main()
{
  vec2 place = gl_FragCoord.xy * texel_mm - 0.5 * window_mm;
  float upper = lid_upper.x - place.x * place.x / lid_upper.y;
  float lower = lid_lower.x + place.x * place.x / lid_lower.y;
  float open_part = clamp(0.5 + (pupil_radius_mm - length(place)) / texel_mm, 0.0, 1.0)
                    * clamp(0.5 + (upper - place.y) / texel_mm, 0.0, 1.0)
                    * clamp(0.5 + (place.y - lower) / texel_mm, 0.0, 1.0);
  out_open = vec4(open_part);
}
