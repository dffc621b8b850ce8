// What the lookup of a light profile calls (addon/materials/nodes/image.py).
#include "lib/closure.glsl"
#include "lib/math.glsl"
