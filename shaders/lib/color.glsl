// Colour conversions that node trees imply.

// Luminance of a scene-linear colour with Rec. 709 primaries: the Y row of its matrix to CIE XYZ.
float color_luminance(vec3 color)
{
  return dot(color, vec3(0.2126390, 0.7151687, 0.0721923));
}

float vector_average(vec3 v)
{
  return (v.x + v.y + v.z) * (1.0 / 3.0);
}

// IEC 61966-2-1 transfer curve, display to scene-linear.
float srgb_decode_channel(float encoded)
{
  if (encoded < 0.04045) {
    return max(encoded, 0.0) * (1.0 / 12.92);
  }
  return pow((encoded + 0.055) * (1.0 / 1.055), 2.4);
}

vec3 srgb_decode(vec3 encoded)
{
  return vec3(srgb_decode_channel(encoded.x), srgb_decode_channel(encoded.y), srgb_decode_channel(encoded.z));
}
