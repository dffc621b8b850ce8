// What lines find of Burley's profile at a cell, over a plane's (subsurface/chord.frag.glsl): 24 bits below zero, rounded at random.
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"

#define LINES_LEVELS 60.0  // to a plane's: that is kept as it is

float pack_lines(vec3 found, uvec3 roll)
{
  roll = hash3(roll);
  vec3 level = found * LINES_LEVELS + vec3(to_unit(roll.x), to_unit(roll.y), to_unit(roll.z)) - vec3(0.5);
  return -1.0 - pack_three(level / 255.0, 255.0);
}

vec3 unpack_lines(float packed_lines)
{
  return unpack_three(-1.0 - packed_lines, 255.0) * (255.0 / LINES_LEVELS);
}
