// Bands of rows of the image of mean reflectances (indirect/reflectance.frag.glsl; BANDS of addon/surfaces/reflectance.py).
#define REFLECTANCE_BANDS 9
