// Half the width of a beam's kernel, in metres: that of the light between neighbouring rays where it starts, and what what
// mirrored it adds on its way. At least and at most some pixels; what a curved mirror spreads may be wider.
#define SPREAD_WIDER 6.0

float beam_half_width(float along, float pixel_size)
{
  float most = beam_most_pixels * ((beam_end.w > 0.0) ? SPREAD_WIDER : 1.0);
  return clamp(beam_flux.w + beam_end.w * along, beam_pixels * pixel_size, most * pixel_size);
}
