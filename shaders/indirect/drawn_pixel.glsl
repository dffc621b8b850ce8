// The pixel of the picture that a pass of indirect light works on; false where it shows no surface. With INTERLEAVED one of
// each rectangle (addon/sampling/interleaved.py).
bool drawn_pixel(out ivec2 pixel)
{
  pixel = ivec2(gl_FragCoord.xy);
#ifdef INTERLEAVED
  pixel = pixel * rectangle + place_within;
  if (any(greaterThanEqual(pixel, surface_position_size()))) {
    return false;
  }
#endif
  return surface_position_fetch(pixel).w != 0.0;
}
