// Bands of rows of the image of mean reflectances (indirect/reflectance.frag.glsl; BANDS of addon/surfaces/reflectance.py), and
// above them the world's wide light: cells of equal solid angle, rows by height, columns by azimuth from minus half a turn on.
#define REFLECTANCE_BANDS 9
#define SKY_ROWS 8
#define SKY_COLUMNS 16  // COLUMNS there

int reflectance_rows()
{
  return (reflectance_size().y - SKY_ROWS) / REFLECTANCE_BANDS;
}
