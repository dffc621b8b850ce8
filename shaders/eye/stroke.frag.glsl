// What a stroke lets pass, to be multiplied with what others do. Thinner than a texel it is drawn a texel wide and as
// much fainter: by its area where it is a disc (whose soft edge adds texel^2 / 12), by its width where it is a line.
void main()
{
  vec2 along = ends.zw - ends.xy;
  vec2 away = place_mm - ends.xy;
  float length2 = dot(along, along);
  float share = (length2 > 0.0) ? clamp(dot(away, along) / length2, 0.0, 1.0) : 0.0;
  float radius = mix(brush.x, brush.y, share);
  float drawn = max(radius, 0.5 * texel_mm);
  float fade = (length2 > 0.0) ? radius / drawn : radius * radius / (drawn * drawn + texel_mm * texel_mm / 12.0);
  float coverage = fade * clamp(0.5 + (drawn - length(away - share * along)) / texel_mm, 0.0, 1.0);
  out_open = vec4(1.0 - brush.z * coverage);
}
